"""Every example in the documentation of the public package runs as printed."""

import doctest
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.parametrize(
    ("module", "least"),
    [
        ("loading", 3),
        ("trials", 1),
        ("trial_sets", 1),
        ("models", 3),
    ],
)
def test_examples_of_a_module_give_their_documented_output(module, least):
    imported = importlib.import_module(f"traction.{module}")
    parts = [test for test in doctest.DocTestFinder().find(imported) if test.examples]
    assert len(parts) >= least
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    for test in parts:
        runner.run(test)
    assert runner.summarize(verbose=False).failed == 0


def test_the_example_of_the_notebook_page_runs(tmp_path, monkeypatch, workplace):
    page = ROOT / "docs" / "notebook.md"
    block, *_ = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
    for name in ("data", "tables"):
        (tmp_path / name).symlink_to(workplace / name)
    monkeypatch.chdir(tmp_path)
    exec(compile(block, str(page), "exec"), {})
    assert {path.name for path in tmp_path.glob("*.pdf")} == {"T01.pdf", "session.pdf"}
