"""Packages that the laboratory needs on the host, and how to install them."""

import shutil
from collections.abc import Callable, Mapping

PROGRAMS: Mapping[str, str] = {
    "qemu-system-x86_64": "qemu-system-x86",
    "setpriv": "util-linux",
    "busybox": "busybox-static",
    "modprobe": "kmod",
    "depmod": "kmod",
    "ip": "iproute2",
    "tc": "iproute2",
    "cansend": "can-utils",
    "dpkg-deb": "dpkg",
    "apt-get": "apt",
}
ALWAYS = ("seabios",)  # firmware of the emulated machine; contains no program to check
SEARCH_PATH = "/usr/sbin:/usr/bin:/sbin:/bin:/usr/local/sbin:/usr/local/bin"


class LabError(Exception):
    """The laboratory cannot be set up; the message gives reason and remedy."""


def find_program(name: str) -> str | None:
    """Return the path of a program, also one that only root has in its PATH."""
    return shutil.which(name) or shutil.which(name, path=SEARCH_PATH)


def missing_packages(
    find: Callable[[str], str | None] = find_program,
) -> list[str]:
    """Return the Debian packages whose programs are missing, sorted."""
    return sorted({package for name, package in PROGRAMS.items() if not find(name)})


def install_line(packages: list[str]) -> str:
    """Return the command that installs `packages`."""
    names = " ".join(sorted({*packages, *ALWAYS}))
    return f"apt-get install --no-install-recommends {names}"


def program(name: str) -> str:
    """Return the path of a program.

    Raises:
        LabError: it is not installed.
    """
    path = find_program(name)
    if path is None:
        raise LabError(
            f"{name} is not installed: {install_line([PROGRAMS.get(name, name)])}"
        )
    return path
