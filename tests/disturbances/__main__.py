"""`python -m tests.disturbances` measures and prints the table of disturbances."""

import sys

from tests.disturbances.table import text

if __name__ == "__main__":
    sys.stdout.write(text())
