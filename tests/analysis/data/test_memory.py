"""The memory budget of a file is a share of the free memory."""

import subprocess
import sys

import pytest

from analysis.data import memory
from analysis.data.memory import share_of_memory


@pytest.fixture
def computer(tmp_path, monkeypatch):
    """A folder that states the free memory and the limit of a control group."""
    monkeypatch.setattr(memory, "_MEMORY", tmp_path / "meminfo")
    monkeypatch.setattr(memory, "_GROUP", tmp_path)
    (tmp_path / "meminfo").write_text("MemTotal: 9 kB\nMemAvailable: 8000 kB\n")
    return tmp_path


def test_the_budget_is_a_share_of_free_memory_above_a_minimum(computer):
    assert share_of_memory(8, 10) == 1_024_000
    assert share_of_memory(8, 2_000_000) == 2_000_000


@pytest.mark.parametrize(("cap", "part"), [("3000000", 250_000), ("max", 1_024_000)])
def test_a_control_group_may_lower_the_budget(computer, cap, part):
    (computer / "memory.max").write_text(cap)
    (computer / "memory.current").write_text("1000000")
    assert share_of_memory(8, 10) == part


@pytest.mark.parametrize("text", ["", "MemAvailable:", "MemAvailable: many kB"])
def test_without_information_the_budget_is_the_minimum(computer, text):
    (computer / "meminfo").write_text(text)
    assert share_of_memory(8, 10) == 10


def test_a_process_limit_may_lower_the_budget():
    """In a separate process, because a limit cannot be raised again."""
    program = (
        "import resource\n"
        "from analysis.data.memory import share_of_memory\n"
        "before = share_of_memory(1, 10)\n"
        "resource.setrlimit(resource.RLIMIT_AS, (2_000_000_000, 2_000_000_000))\n"
        "print(before, share_of_memory(1, 10))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    before, after = map(int, done.stdout.split())
    assert 1_000_000 < after < min(before, 2_000_000_000)
