import os
import platform
import resource
import subprocess
import sys

import numpy as np
import pytest

_FIRST_TASK = """
import os
os.environ.pop("OPENBLAS_NUM_THREADS", None)
from analysis.study.tasks import run_tasks
from tests.analysis.study.test_one_thread import threads
print(run_tasks(threads, [0, 1], 1))
"""
_MATRIX = 720_000  # bytes of 300 rows


def threads(_):
    """Return the most threads of a linear-algebra library, SciPy's own among them."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_info

    return max(library["num_threads"] for library in threadpool_info())


def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt


@pytest.mark.slow
def test_the_first_task_of_a_process_has_one_thread():
    done = subprocess.run(
        [sys.executable, "-c", _FIRST_TASK], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[1, 1]"


def test_a_thread_limit_applies_to_every_solver_library():
    code = (
        "import analysis.gp.regression\n"
        "from threadpoolctl import threadpool_limits\n"
        "with threadpool_limits(1):\n"
        "    from tests.analysis.study.test_one_thread import threads\n"
        "    print(threads(0))"
    )
    environment = {k: v for k, v in os.environ.items() if "NUM_THREADS" not in k}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=environment | {"OPENBLAS_NUM_THREADS": "3"},
    )
    assert done.stdout.strip() == "1"


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_matrix_memory_is_reused():
    from acquisition.linear_algebra import keep_heap

    assert keep_heap()
    np.ones(_MATRIX // 8)
    before = faults()
    for _ in range(100):
        np.ones(_MATRIX // 8)
    assert faults() - before < 100 * _MATRIX / 4096 / 4


def test_the_program_leaves_cores_to_other_processes():
    code = "from experiments.__main__ import main; main(['status', '--help'])"
    asked = (
        "import os, atexit; "
        "atexit.register(lambda: print(os.environ['OPENBLAS_NUM_THREADS']));"
    )
    for given, expected in ((None, "1"), ("2", "2")):
        setting = (
            "" if given is None else f"os.environ['OPENBLAS_NUM_THREADS']='{given}';"
        )
        forget = "os.environ.pop('OPENBLAS_NUM_THREADS', None);"
        done = subprocess.run(
            [sys.executable, "-c", asked + forget + setting + code],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stdout.splitlines()[-1] == expected
