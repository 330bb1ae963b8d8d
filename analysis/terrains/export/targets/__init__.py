"""Export formats, one per module; each defines `TARGET`.

To add a format, add a module here; the command finds it by its name.
"""
