"""Trial files in MCAP: writer, reader, verification, recovery.

`writer` appends whole chunks that survive a power cut, `reader` returns validated
arrays, `verify` reads a file back completely, `recover` copies the sound records of a
damaged one. The only package that imports mcap. Begin with `writer`.
"""
