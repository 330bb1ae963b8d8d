"""Pictures of a report as readers see it, to be looked at.

python docs/screenshots.py REPORT/index.html FOLDER

Needs Chromium. Writes PNG at 1,400, 800 and 390 pixels, light and dark, and the page as
it is printed (PDF).
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WIDTHS = (1400, 800, 390)  # pixels
HEIGHT = 6000  # pixels
# A headless window is no narrower than 500: a frame in it is.
_FRAME = '<body style="margin:0"><iframe src="{uri}" style="border:0" width="{width}" '
_FRAME += f'height="{HEIGHT}"></iframe>'


def browser() -> str:
    """Return the first browser that is installed; end the program without one."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        sys.exit(f"None of {', '.join(BROWSERS)} was found.")
    return found


def take(program: str, page: Path, *options: str) -> None:
    """Open `page` headless with `options`."""
    command = [program, "--headless", "--no-sandbox", "--disable-gpu"]
    command += ["--hide-scrollbars", *options, page.as_uri()]
    subprocess.run(command, check=True, capture_output=True, timeout=300)


def main() -> None:
    """Write the pictures and say where they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("folder", type=Path)
    given = parser.parse_args()
    page, folder, program = given.page.resolve(), given.folder.resolve(), browser()
    folder.mkdir(parents=True, exist_ok=True)
    frame = folder / "frame.html"
    for width in WIDTHS:
        frame.write_text(_FRAME.format(uri=page.as_uri(), width=width))
        for name, scheme in (("light", 1), ("dark", 0)):
            picture = folder / f"{width}-{name}.png"
            size = f"--window-size={max(width, 500)},{HEIGHT}"
            colours = f"--blink-settings=preferredColorScheme={scheme}"
            take(program, frame, size, colours, f"--screenshot={picture}")
            print(picture)  # noqa: T201
    frame.unlink()
    printed = folder / "print.pdf"
    take(program, page, "--no-pdf-header-footer", f"--print-to-pdf={printed}")
    print(printed)  # noqa: T201


if __name__ == "__main__":
    main()
