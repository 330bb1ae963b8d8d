"""`python -m tests.borders` prints the table of borders."""

import sys

from tests.borders.table import text

if __name__ == "__main__":
    sys.stdout.write(text())
