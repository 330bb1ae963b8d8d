"""The version of every file that Traction writes, and what is said of another one.

All formats are 1.0; `docs/data.md` says what is in each. What was recorded in it stays
readable in every later version.
"""

FORMAT = "1.0"


def format_problem(stated: object) -> str:
    """Return why a file that states this version is not read; "" if it is.

    Args:
        stated: what the file says of its version; None = nothing.
    """
    if stated == FORMAT:
        return ""
    known = f"this program reads version {FORMAT}"
    if stated is None:
        return f"states no version; {known}"
    return f"is of version {str(stated)[:20]!r}; {known}"
