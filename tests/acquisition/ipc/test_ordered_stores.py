"""Shared memory needs a processor that keeps the order of stores."""

import os
import platform

import pytest

from acquisition.errors import PreflightError
from acquisition.ipc.shared_memory import SharedMemory, require_ordered_stores


@pytest.mark.parametrize("machine", ["x86_64", "AMD64", "i386", "i686"])
def test_an_x86_orders_stores(machine, monkeypatch):
    monkeypatch.setattr(platform, "machine", lambda: machine)
    require_ordered_stores()


@pytest.mark.parametrize("machine", ["aarch64", "arm64", "riscv64", "ppc64le", ""])
def test_any_other_machine_is_refused_by_name(machine, monkeypatch):
    monkeypatch.setattr(platform, "machine", lambda: machine)
    with pytest.raises(PreflightError, match=machine or "unknown") as refused:
        require_ordered_stores()
    assert "Simulations run here with --fake" in refused.value.hint


def test_another_system_is_refused_by_name(monkeypatch):
    monkeypatch.setattr(platform, "system", lambda: "Darwin")
    monkeypatch.delattr(os, "memfd_create")
    with pytest.raises(PreflightError, match="This system is Darwin") as refused:
        require_ordered_stores()
    assert "Simulations run here with --fake" in refused.value.hint


def test_memory_of_one_process_needs_no_linux(monkeypatch):
    monkeypatch.delattr(os, "memfd_create")
    memory = SharedMemory.create(100)
    memory.view[:4] = b"abcd"
    assert bytes(memory.view) == b"abcd" + bytes(96)
    memory.close()
