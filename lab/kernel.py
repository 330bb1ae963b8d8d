"""Debian's kernel: download, unpacking, and the load order of its modules."""

import lzma
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from lab.requirements import LabError, program

META_PACKAGE = "linux-image-amd64"
MODULES = (
    "virtio_pci",
    "9p",
    "9pnet_virtio",
    "overlay",
    "virtio_console",
    "virtio-rng",
    "can",
    "can-raw",
    "vcan",
    "kvaser_pci",
    "slcan",
    "sch_netem",
    "xhci-pci",
    "usbserial",
    "ftdi_sio",
)
_IMAGE = re.compile(r"Depends: (linux-image-\S+-amd64)")
_XZ = b"\xfd7zXZ\x00"
_FETCH_SECONDS = 300


@dataclass(frozen=True, slots=True)
class Kernel:
    """An unpacked kernel.

    Attributes:
        image: bootable file.
        modules: module files in load order.
    """

    image: Path
    modules: tuple[Path, ...]


def image_package(depends: str) -> str:
    """Return the kernel's package from the output of `apt-cache depends`.

    Raises:
        LabError: the output names no package.
    """
    match = _IMAGE.search(depends)
    if match is None:
        raise LabError(
            f"apt-cache knows no {META_PACKAGE}: the laboratory needs Debian's kernel "
            "for amd64; try apt-get update."
        )
    return match[1]


def fetch_kernel(cache: Path) -> Kernel:
    """Return the kernel below `cache`; download and unpack it the first time.

    Raises:
        LabError: the download failed.
    """
    # A cached kernel needs no network.
    folder = next(iter(sorted(cache.glob("kernel/linux-image-*"))), None)
    if folder is None:
        folder = _unpack(cache)
    release = folder.name.removeprefix("linux-image-")
    image = _unpacked(folder / "boot" / f"vmlinuz-{release}", folder / "vmlinux")
    return Kernel(image, _load_order(folder, release))


def _unpacked(packed: Path, plain: Path) -> Path:
    """Return the kernel as an ELF file, or `packed` if it is not compressed with xz.

    Unpacking in the emulator would take twenty times as long.
    """
    if not plain.exists():
        content = packed.read_bytes()
        start = content.find(_XZ)
        if start < 0:
            return packed
        elf = lzma.LZMADecompressor().decompress(content[start:])
        partial = plain.with_suffix(".partial")
        partial.write_bytes(elf)
        partial.rename(plain)
    return plain


def _unpack(cache: Path) -> Path:
    package = image_package(_run(["apt-cache", "depends", META_PACKAGE]))
    downloads = cache / "downloads"
    downloads.mkdir(parents=True, exist_ok=True)
    _run([program("apt-get"), "download", package], cwd=downloads)
    archive = max(downloads.glob(f"{package}_*.deb"))
    folder = cache / "kernel" / package
    partial = cache / f"{package}.partial"
    _run([program("dpkg-deb"), "-x", str(archive), str(partial)])
    release = package.removeprefix("linux-image-")
    _run([program("depmod"), "-b", str(partial), release])
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial.rename(folder)
    archive.unlink()
    return folder


def _load_order(folder: Path, release: str) -> tuple[Path, ...]:
    base = [program("modprobe"), "-d", str(folder), "-S", release, "--show-depends"]
    files: dict[Path, None] = {}
    for name in MODULES:
        for line in _run([*base, name]).splitlines():
            words = line.split()
            if words[:1] == ["insmod"]:
                files[Path(words[1])] = None
    return tuple(files)


def _run(command: list[str], cwd: Path | None = None) -> str:
    try:
        done = subprocess.run(
            command,
            cwd=cwd,
            capture_output=True,
            text=True,
            check=True,
            timeout=_FETCH_SECONDS,
        )
    except subprocess.CalledProcessError as error:
        raise LabError(f"{' '.join(command)} failed: {error.stderr.strip()}") from error
    except (OSError, subprocess.TimeoutExpired) as error:
        raise LabError(f"{' '.join(command)} failed: {error}") from error
    return done.stdout
