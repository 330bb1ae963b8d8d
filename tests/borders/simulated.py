"""The column `simulated` of tables, and mixed simulated and recorded tables."""

import io
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np

import traction as tr
from acquisition.errors import SettingsError
from analysis.tables.loading import load_tables
from experiments.__main__ import main
from tests.borders.row import Answer, Border, Outcome
from tests.borders.tables import COUNT, NAMES, ROWS, VALUES, refused, text

_MARKED = (*NAMES, "simulated [1]")


def _marked(mark: str) -> str:
    return text([[*row, mark] for row in ROWS], names=_MARKED)


def _kind(path: Path) -> Answer:
    ((series,),) = load_tables([path]).values()
    return Answer(Outcome.READ, "simulated" if series.is_simulated else "recorded")


def _csv(mark: str) -> Border:
    def act(folder: Path) -> Answer:
        (folder / "T02.csv").write_text(_marked(mark))
        return _kind(folder / "T02.csv")

    says = "simulated" if mark == "1" else "recorded"
    return Border(f"CSV with column simulated = {mark}", Outcome.READ, says, act)


def _parquet(folder: Path) -> Answer:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = dict(zip(NAMES, VALUES.T, strict=True))
    marked = columns | {"simulated": np.ones(COUNT, dtype=bool)}
    pq.write_table(pa.table(marked), folder / "T02.parquet")
    return _kind(folder / "T02.parquet")


def _both(folder: Path) -> list[str]:
    (folder / "T02.csv").write_text(_marked("1"))
    (folder / "real.csv").write_text(text())
    return [str(folder / "T02.csv"), str(folder / "real.csv")]


def _loaded(folder: Path) -> Answer:
    try:
        tr.fit(tr.load_tables(_both(folder)), "tustin")
    except SettingsError as error:
        return Answer(Outcome.REFUSED, str(error))
    return Answer(Outcome.WRONG, "fitted")


def _fitted(folder: Path) -> Answer:
    output = io.StringIO()
    with redirect_stderr(output), redirect_stdout(output):
        code = main(["fit", *_both(folder), "--to", str(folder / "report")])
    is_refused = code == SettingsError.exit_code and not (folder / "report").exists()
    outcome = Outcome.REFUSED if is_refused else Outcome.WRONG
    return Answer(outcome, " ".join(output.getvalue().split()))


SIMULATED: tuple[Border, ...] = (
    _csv("1"),
    _csv("0"),
    Border("Parquet with column simulated = true", Outcome.READ, "simulated", _parquet),
    refused(
        "CSV with a changing column simulated",
        _marked("1") + _marked("0").partition("\n")[2],
        f"line {COUNT + 2}, column simulated: '0'",
    ),
    Border(
        "traction fit of simulated and recorded tables",
        Outcome.REFUSED,
        "cannot mix simulated and recorded trials",
        _fitted,
    ),
    Border(
        "traction.fit of simulated and recorded tables",
        Outcome.REFUSED,
        "cannot be mixed",
        _loaded,
    ),
)
