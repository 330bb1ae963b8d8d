"""Trial files: MCAP written, read, verified and salvaged.

`writer` appends whole chunks that survive a power cut, `reader` returns arrays that
have been checked, `verify` reads a file back completely, `recover` saves what is sound
in a damaged one. The only package that imports mcap. Begin with `writer`.
"""
