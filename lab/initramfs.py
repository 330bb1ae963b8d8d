"""The machine's initramfs: busybox, kernel modules and an init script."""

import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

INIT = """\
#!/bin/busybox sh
export PATH=/bin
/bin/busybox --install -s /bin
mkdir -p /proc /sys /dev /host /upper /new
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
while read name; do insmod /modules/$name || echo "lab: $name is not loaded"; done \\
    < /modules/order
mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=loose,ro host /host
mount -t tmpfs -o size=16g upper /upper
mkdir -p /upper/files /upper/work
mount -t overlay -o lowerdir=/host,upperdir=/upper/files,workdir=/upper/work root /new
mount --move /proc /new/proc
mount --move /sys /new/sys
mount --move /dev /new/dev
mkdir -p /new/dev/shm /new/dev/pts
mount -t tmpfs shm /new/dev/shm
mount -t devpts -o ptmxmode=666 pts /new/dev/pts
mount -t tmpfs -o size=16g run /new/run
mkdir -p /new/run/lab
cp /job /new/run/lab/job
exec switch_root /new /bin/sh /run/lab/job
"""
_TRAILER = "TRAILER!!!"
_CONSOLE = (5, 1)  # major, minor


@dataclass(frozen=True, slots=True)
class Entry:
    """One file of an archive.

    Attributes:
        name: path without the leading slash.
        mode: type and permissions.
        content: bytes of a regular file.
        device: major and minor number of a device.
    """

    name: str
    mode: int
    content: bytes = b""
    device: tuple[int, int] = (0, 0)


def cpio(entries: Iterable[Entry]) -> bytes:
    """Return an archive in the "newc" format of the kernel."""
    rows = [*entries, Entry(_TRAILER, 0)]
    return b"".join(_packed(number, row) for number, row in enumerate(rows, start=1))


def _packed(number: int, entry: Entry) -> bytes:
    name = entry.name.encode() + b"\0"
    major, minor = entry.device
    fields = (
        number,
        entry.mode,
        0,  # owner
        0,  # group
        1,  # links
        0,  # time
        len(entry.content),
        0,
        0,
        major,
        minor,
        len(name),
        0,  # no checksum
    )
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + name
    return _padded(head) + _padded(entry.content)


def _padded(part: bytes) -> bytes:
    return part + b"\0" * (-len(part) % 4)


def build(busybox: Path, modules: Iterable[Path], job: str) -> bytes:
    """Return the initramfs archive.

    Args:
        busybox: the statically linked program.
        modules: kernel modules in the order of loading.
        job: shell script, run as process 1 on the host's root file system.
    """
    files = list(modules)
    order = "".join(f"{path.name}\n" for path in files)
    entries = [
        Entry("bin", stat.S_IFDIR | 0o755),
        Entry("dev", stat.S_IFDIR | 0o755),
        Entry("modules", stat.S_IFDIR | 0o755),
        Entry("dev/console", stat.S_IFCHR | 0o600, device=_CONSOLE),
        Entry("bin/busybox", stat.S_IFREG | 0o755, busybox.read_bytes()),
        Entry("init", stat.S_IFREG | 0o755, INIT.encode()),
        Entry("job", stat.S_IFREG | 0o755, job.encode()),
        Entry("modules/order", stat.S_IFREG | 0o644, order.encode()),
        *(
            Entry(f"modules/{path.name}", stat.S_IFREG | 0o644, path.read_bytes())
            for path in files
        ),
    ]
    return cpio(entries)
