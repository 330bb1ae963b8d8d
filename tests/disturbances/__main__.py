"""`python -m tests.disturbances > docs/disturbances.md` measures it anew."""

import sys

from tests.disturbances.page import page

if __name__ == "__main__":
    sys.stdout.write(page())
