"""The archive of the initramfs is unpacked by an independent reader."""

import stat

from lab.initramfs import Entry, build, cpio


def unpack(archive):
    """Return {name: (mode, content, device)} of an archive in the form "newc"."""
    files, offset = {}, 0
    while True:
        head = archive[offset : offset + 110]
        assert head[:6] == b"070701"
        fields = [int(head[6 + 8 * n : 14 + 8 * n], 16) for n in range(13)]
        mode, size, device, length = fields[1], fields[6], fields[9:11], fields[11]
        name_end = offset + 110 + length
        name = archive[offset + 110 : name_end - 1].decode()
        start = name_end + -name_end % 4
        offset = start + size + -(start + size) % 4
        if name == "TRAILER!!!":
            assert offset == len(archive)
            return files
        files[name] = (mode, archive[start : start + size], tuple(device))


def test_files_of_every_length_round_trip():
    contents = [b"x" * n for n in range(9)]
    entries = [
        Entry("n" * (n + 1), stat.S_IFREG | 0o644, content)
        for n, content in enumerate(contents)
    ]
    assert [row[1] for row in unpack(cpio(entries)).values()] == contents


def test_the_root_has_a_console_init_and_modules_in_their_order(tmp_path):
    busybox, modules = tmp_path / "busybox", []
    busybox.write_bytes(b"ELF")
    for name in ("can.ko", "9p.ko"):
        modules.append(tmp_path / name)
        modules[-1].write_bytes(name.encode())
    files = unpack(build(busybox, modules, "echo job\n"))
    mode, _, device = files["dev/console"]
    assert stat.S_ISCHR(mode)
    assert device == (5, 1)
    assert files["modules/order"][1] == b"can.ko\n9p.ko\n"
    assert files["modules/9p.ko"][1] == b"9p.ko"
    assert files["job"][1] == b"echo job\n"
    assert files["init"][0] & 0o111
