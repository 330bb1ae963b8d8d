"""`traction setup` prints the files that it writes below a root, and only these."""

import sys

import pytest

from experiments.preflight.host_setup import run_all
from tests.experiments.program import traction, write_config

NAMES = {
    "etc/udev/rules.d/80-traction.rules",
    "etc/security/limits.d/80-traction.conf",
    "etc/systemd/system/traction-can0.service",
}


def written(root):
    return {str(p.relative_to(root)) for p in root.rglob("*") if not p.is_dir()}


def install(root, *more):
    return traction(
        "setup", "--install", "--root", root, "--sensor-serial", "A1", *more
    )


@pytest.fixture
def root(tmp_path):
    folder = tmp_path / "image"
    folder.mkdir()
    return folder


def test_the_printed_files_are_the_written_ones(root):
    printed = traction("setup", "--sensor-serial", "A1", "--user", "someone").out
    assert written(root) == set()
    assert install(root, "--user", "someone").code == 0
    assert written(root) == NAMES
    for name in NAMES:
        assert f"# ---- /{name}" in printed
        assert (root / name).read_text() in printed
    assert "usermod --append --groups traction,dialout someone" in printed
    assert 'ATTRS{serial}=="A1"' in printed
    assert "systemctl enable traction-can0.service" in printed


def test_a_second_setup_changes_nothing_and_new_settings_are_written(root, tmp_path):
    install(root)
    again = install(root)
    assert "as they should be" in again.out
    config = write_config(tmp_path, rig=('"can0"', '"can1"'))
    assert "traction-can1.service" in install(root, "--config", config).out
    unit = (root / "etc/systemd/system/traction-can1.service").read_text()
    assert "link set can1 up txqueuelen 16 type can bitrate 1000000" in unit


def test_a_foreign_file_is_left_alone(root):
    rules = root / "etc/udev/rules.d/80-traction.rules"
    rules.parent.mkdir(parents=True)
    rules.write_text("mine\n")
    done = install(root)
    assert done.code == 2
    assert "was not written by traction setup" in done.err
    assert written(root) == {"etc/udev/rules.d/80-traction.rules"}
    assert rules.read_text() == "mine\n"


def test_a_link_out_of_the_root_is_refused(root, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (root / "etc").mkdir()
    (root / "etc/udev").symlink_to(outside)
    done = install(root)
    assert done.code == 2
    assert "leads out of" in done.err
    assert list(outside.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--user", "x;reboot"),
        ("--user", "-x"),
        ("--sensor-serial", 'a", RUN+="/bin/sh'),
        ("--sensor-serial", ""),
    ],
)
def test_unsafe_or_empty_names_are_refused(option, value, root):
    done = install(root, f"{option}={value}")
    assert done.code == 2
    assert "Nothing was written" in done.err
    assert written(root) == set()


def test_a_bus_without_socketcan_has_no_unit(root, tmp_path):
    config = write_config(tmp_path, rig=('"socketcan"', '"slcan"'))
    install(root, "--config", config)
    assert not [name for name in written(root) if "systemd" in name]


def test_commands_that_fail_or_are_missing_are_reported():
    good, bad = [sys.executable, "-c", ""], [sys.executable, "-c", "exit('no')"]
    failed = run_all([good, bad, ["no-such-program-here"]])
    assert len(failed) == 2
    assert failed[0].endswith(": no")
    assert failed[1].startswith("no-such-program-here: ")
