"""Programs that read terrains, one a module: each has its `TARGET`.

A further one is a further module here; the command finds it by its name.
"""
