"""A forked process behaves like an executed one.

Each test forks an interpreter without threads; a test runner has some.
"""

import subprocess
import sys

import pytest

_HEAD = """\
import os, signal, subprocess, sys
from lab.guest.warm_start import WarmPopen, in_place_of

def start(run, *, command=("traction", "check"), **options):
    become = in_place_of(command, run, options.get("pass_fds", ()))
    return subprocess.Popen(command, preexec_fn=become, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, start_new_session=True, **options)

def tell(run, **options):
    process = start(run, **options)
    out, err = process.communicate(timeout=20)
    print(process.returncode, out.strip(), err.strip().splitlines()[-1:])
"""


def outcome(code):
    done = subprocess.run(
        [sys.executable, "-c", _HEAD + code],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("how", "expected"),
    [
        ("sys.exit(4)", "4  []"),
        ("sys.exit()", "0  []"),
        ("print('done')", "0 done []"),
        ("sys.exit('no rig')", "1  ['no rig']"),
        (
            "int('x')",
            "1  [\"ValueError: invalid literal for int() with base 10: 'x'\"]",
        ),
    ],
)
def test_a_forked_process_exits_like_an_interpreter(how, expected):
    assert outcome(f"def run(): {how}\ntell(run)") == expected


def test_a_forked_process_has_the_arguments_of_its_command():
    assert outcome("def run(): print(sys.argv)\ntell(run)") == (
        "0 ['traction', 'check'] []"
    )


def test_a_forked_process_has_the_signal_handlers_of_a_fresh_one():
    code = """\
signal.signal(signal.SIGTERM, signal.SIG_IGN)
def run():
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGPIPE) is signal.SIG_IGN
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
tell(run)
"""
    assert outcome(code) == "0  []"


def test_a_forked_process_inherits_no_other_descriptor():
    code = """\
read, write = os.pipe()
def run():
    os.fstat(read)
    os.fstat(write)
tell(run, pass_fds=(read,))
"""
    assert outcome(code) == "1  ['OSError: [Errno 9] Bad file descriptor']"


def test_a_forked_process_keeps_the_descriptors_it_is_given():
    code = """\
read, write = os.pipe()
def run(): os.write(write, b"from the child")
tell(run, pass_fds=(read, write))
print(os.read(read, 99))
"""
    assert outcome(code) == "0  []\nb'from the child'"


def test_a_killed_process_is_reported_as_killed():
    code = """\
def run():
    print("here", flush=True)
    signal.pause()
process = start(run)
process.stdout.readline()
process.kill()
print(process.wait(20))
"""
    assert outcome(code) == "-9"


def test_a_child_of_a_forked_process_has_its_own_environment():
    code = """\
marker = ["loaded here"]
sys.modules["marked"] = marker
def run():
    text = "import os, sys; print(sys.modules['marked'], sys.argv[1], os.environ['A'])"
    command = [sys.executable, "-P", "-c", text, "operand"]
    child = subprocess.run(command, env={**os.environ, "A": "b"}, stdout=1)
    sys.exit(child.returncode)
tell(run)
"""
    assert outcome(code) == "0 ['loaded here'] operand b []"


def test_another_command_is_executed():
    code = """\
def run(): sys.exit(subprocess.run(["/bin/sh", "-c", "echo $0"]).returncode)
tell(run)
"""
    assert outcome(code) == "0 /bin/sh []"
