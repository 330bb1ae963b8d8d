"""How Sphinx makes the documentation: `make docs`, read in docs/_build/html."""

import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE), str(ROOT)]

project = "Traction"
author = "the Traction project"
extensions = ["myst_parser", "autodoc2"]
myst_enable_extensions = ["attrs_inline"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "Traction"
exclude_patterns = ["_build"]
autodoc2_packages = [
    {"path": "../traction", "module": "traction"},
    {
        "path": "../analysis/terrains/database.py",
        "module": "analysis.terrains.database",
    },
    {"path": "../wam/model/arm_model.py", "module": "wam.model.arm_model"},
    {"path": "../wam/calibration", "module": "wam.calibration"},
    {"path": "../ft_sensor/calibration", "module": "ft_sensor.calibration"},
]
autodoc2_output_dir = "api"
autodoc2_render_plugin = "myst"
autodoc2_hidden_objects = {"private", "dunder", "inherited"}
autodoc2_docstring_parser_regexes = [(r".*", "plain_docstrings")]

# Pages of the project's own folder, whose links begin there.
_PAGES = ("ARCHITECTURE", "CHANGELOG", "CONTRIBUTING", "DECISIONS", "SECURITY")


def _as_page(text: str) -> str:
    text = re.sub(r"\]\(docs/", "](../", text)
    names = "|".join(_PAGES)
    return re.sub(rf"\]\(({names})\.md\)", lambda m: f"]({m[1].lower()}.md)", text)


(HERE / "project").mkdir(exist_ok=True)
for _name in _PAGES:
    _text = _as_page((ROOT / f"{_name}.md").read_text(encoding="utf-8"))
    (HERE / "project" / f"{_name.lower()}.md").write_text(_text, encoding="utf-8")

# The messages as the program holds them.
from experiments.messages import catalogue_table  # noqa: E402

_MESSAGES = """# Messages

Every message says what happened, what the arm is doing, what to do, and what is safe.
`traction check --explain NAME` says more of one.

"""
(HERE / "project" / "messages.md").write_text(
    _MESSAGES + "\n".join(catalogue_table()) + "\n", encoding="utf-8"
)


def _link_pages(_app: object, _name: str, source: list[str]) -> None:
    """Let links to the project's own folder reach the pages made from it above."""
    names = "|".join(_PAGES)
    source[0] = re.sub(
        rf"\]\(\.\./({names})\.md", lambda m: f"](project/{m[1].lower()}.md", source[0]
    )


def setup(app: Any) -> None:  # noqa: ANN401
    """Connect what changes a page while it is read."""
    app.connect("source-read", _link_pages)
