"""The emulated machine: its command line, its console, its processes."""

import contextlib
import os
import queue
import socket
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

from acquisition.clock import NS_PER_S, SystemClock
from lab import local_timer
from lab.calls import MEMORY_SIZE
from lab.kernel import Kernel
from lab.requirements import program
from lab.results import TimerLocation

# With -icount an instruction takes 1 ns. The kernel is told that the time stamp counter
# runs six times faster than it does, so all of its time passes six times slower than
# the processor's: driver, recorder and console then fit into one cycle.
SLOWNESS = 6
_APPEND = (
    "console=ttyS0 quiet panic=-1 mitigations=off nokaslr random.trust_cpu=on "
    f"tsc_early_khz={SLOWNESS}000000 clocksource=tsc tsc=reliable lpj=4000000"
)
# Copy whole words instead of bytes, and use page tables of four levels instead of five:
# both are emulated step by step.
_PROCESSOR = "max,erms=off,la57=off"
MEMORY_MB = 3072
_CLOCK = SystemClock()


@dataclass(frozen=True, slots=True)
class Sockets:
    """Paths of a machine's Unix sockets and shared memory, kept short.

    Attributes:
        line: far end of the serial adapter.
        monitor: QEMU's monitor, for plugging devices in and out.
        memory: file shared by the guest and the simulated arm.
        debugger: QEMU's gdb stub.
    """

    line: Path
    monitor: Path
    memory: Path
    debugger: Path


def command(kernel: Kernel, initramfs: Path, sockets: Sockets, proxy: int) -> list[str]:
    """Return the command line of the machine.

    Both ends of the serial adapter and of QEMU's monitor are in the guest: each socket
    is connected to a virtio port, so that a simulated sensor also runs on guest time.
    `proxy` is the descriptor of the socket to the simulated arm.
    """
    options = (
        f"-accel tcg -cpu {_PROCESSOR} -smp 1 -nodefaults -no-reboot -display none "
        "-serial stdio -icount shift=0,sleep=off -no-hpet "
        "-rtc base=2026-01-01T08:00:00,clock=vm "
        # qboot with the unpacked kernel boots a few seconds faster
        "-bios qboot.rom"
    )
    return [
        # a machine would go on for ever after this process was killed
        *(program("setpriv"), "--pdeathsig", "KILL"),
        program("qemu-system-x86_64"),
        *options.split(),
        *_memory(),
        *_options(
            ("-kernel", str(kernel.image)),
            ("-initrd", str(initramfs)),
            ("-append", _APPEND),
        ),
        *_host_files(),
        *_can_cards(),
        *_serial_adapter(sockets.line),
        *_monitor(sockets.monitor),
        *_far_side(sockets.memory, proxy),
        *_options(("-gdb", f"unix:{sockets.debugger},server=on,wait=off")),
    ]


def _options(*pairs: tuple[str, str]) -> list[str]:
    """Return options and their values as words of a command."""
    return [word for pair in pairs for word in pair]


def _host_files() -> list[str]:
    where = "local,id=host,path=/,security_model=none,readonly=on,multidevs=remap"
    return _options(
        ("-fsdev", where),
        ("-device", "virtio-9p-pci,fsdev=host,mount_tag=host"),
        ("-device", "virtio-rng-pci"),
    )


def _can_cards() -> list[str]:
    """Return the options of two cards on one bus that can be unplugged."""
    return _options(
        ("-object", "can-bus,id=bus0"),
        ("-device", "kvaser_pci,canbus=bus0,id=card0,addr=0x10"),
        ("-device", "kvaser_pci,canbus=bus0,id=card1,addr=0x11"),
    )


def _serial_adapter(socket: Path) -> list[str]:
    return _options(
        ("-device", "qemu-xhci,id=usb"),
        ("-device", "virtio-serial-pci,id=ports"),
        ("-chardev", f"socket,id=line,path={socket},server=on,wait=off"),
        ("-device", "usb-serial,chardev=line,always-plugged=on,id=adapter"),
        ("-chardev", f"socket,id=far,path={socket}"),
        ("-device", "virtserialport,chardev=far,name=lab.line,nr=1"),
    )


def _monitor(socket: Path) -> list[str]:
    return _options(
        ("-chardev", f"socket,id=monitor,path={socket},server=on,wait=off"),
        ("-mon", "chardev=monitor,mode=control"),
        ("-chardev", f"socket,id=operator,path={socket}"),
        ("-device", "virtserialport,chardev=operator,name=lab.monitor,nr=2"),
    )


def _memory() -> list[str]:
    """Return the options of RAM with a descriptor, which the proxy device requires."""
    return _options(
        ("-m", str(MEMORY_MB)),
        ("-machine", "memory-backend=ram"),
        ("-object", f"memory-backend-memfd,id=ram,size={MEMORY_MB}M,share=on"),
    )


def _far_side(memory: Path, proxy: int) -> list[str]:
    """Return the options of memory shared with the simulated arm and of the proxy."""
    size = f"share=on,mem-path={memory},size={MEMORY_SIZE}"
    return _options(
        ("-object", f"memory-backend-file,id=shared,{size}"),
        ("-device", "ivshmem-plain,memdev=shared"),
        ("-device", f"x-pci-proxy-dev,fd={proxy}"),
    )


class Machine:
    """A running machine and its simulated arm; its console is read line by line."""

    def __init__(self, kernel: Kernel, initramfs: Path, sockets: Sockets) -> None:
        sockets.memory.write_bytes(bytes(MEMORY_SIZE))
        here, there = socket.socketpair()
        with here, there:
            self._far_side = subprocess.Popen(
                far_command(sockets.memory, there.fileno()),
                stdin=subprocess.DEVNULL,
                pass_fds=(there.fileno(),),
            )
            self._process = subprocess.Popen(
                command(kernel, initramfs, sockets, here.fileno()),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(here.fileno(),),
            )
        self._debugger = sockets.debugger
        self._used = [0.0, 0.0]  # s of processor time, by process
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def line(self, until_ns: int) -> str | None:
        """Return the console's next line; None once the machine has ended.

        Args:
            until_ns: the host's monotonic time after which the machine counts as hung.

        Raises:
            TimeoutError: no line arrived until then.
        """
        left = (until_ns - _CLOCK.now_ns()) / NS_PER_S
        try:
            return self._lines.get(timeout=max(0.0, left))
        except queue.Empty:
            raise TimeoutError from None

    def processor_seconds(self) -> float:
        """Return the processor time of both processes so far [s]."""
        for number, process in enumerate((self._process, self._far_side)):
            with contextlib.suppress(OSError):  # the process has ended
                self._used[number] = _cpu_time(process.pid)
        return sum(self._used)

    def correct_timer(self, found: TimerLocation) -> None:
        """Set the true rate of the kernel's local timer; raises DebuggerError."""
        local_timer.correct(self._debugger, found.events, found.offsets, SLOWNESS)

    def close(self) -> None:
        """Kill the machine and its arm; safe to repeat."""
        for process in (self._process, self._far_side):
            process.kill()
            process.wait()
        self._reader.join()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        with contextlib.closing(self._process.stdout) as stream:
            for line in stream:
                self._lines.put(line.decode(errors="replace").rstrip())
        self._lines.put(None)


def far_command(memory: Path, link: int) -> list[str]:
    """Return the command of the process that simulates the arm.

    Args:
        memory: file of the memory shared with the guest.
        link: descriptor of the process's end of the proxy device's socket.
    """
    options = ["--link", str(link), "--memory", str(memory)]
    return [sys.executable, "-m", "lab.far", *options]


def _cpu_time(pid: int) -> float:
    """Return the processor time of a process [s]; raises OSError once it has ended."""
    stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    # The name in parentheses may contain any character.
    user, system = stat.rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
