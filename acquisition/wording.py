"""Wording of messages."""


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, e.g. "1 trial" or "3 trials".

    Args:
        number: how many.
        noun: singular; its plural ends in s.
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
