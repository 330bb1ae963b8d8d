"""Parts of exported files that are the same for every database.

`queries.h` is what a C header asks of a terrain.
"""
