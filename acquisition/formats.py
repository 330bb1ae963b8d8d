"""Format version of all files written by Traction.

All formats are version 1.0, described in `docs/data.md`. Later versions of the program
must keep reading it.
"""

FORMAT = "1.0"


def format_problem(stated: object) -> str:
    """Return why a file of the version `stated` is not readable; "" if it is.

    Args:
        stated: version in the file; None = missing.
    """
    if stated == FORMAT:
        return ""
    supported = f"this program reads version {FORMAT}"
    if stated is None:
        return f"states no version; {supported}"
    return f"is of version {str(stated)[:20]!r}; {supported}"
