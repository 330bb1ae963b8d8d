"""`python -m tests.borders > docs/borders.md` writes the table of borders."""

import sys

from tests.borders.page import page

if __name__ == "__main__":
    sys.stdout.write(page())
