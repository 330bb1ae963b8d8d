"""commissioning.html: what commissioning.json says, drawn beside an earlier one."""

from collections.abc import Sequence
from pathlib import Path

from acquisition.files import open_directory, replace_file
from analysis.report.limit_page import (
    LimitedStep,
    LimitedValue,
    LimitPage,
    limit_html,
)
from experiments.commissioning.record import Commissioning, Measured, StepRecord

NAME = "commissioning.html"


def write_page(
    folder: Path,
    record: Commissioning,
    lacking: Sequence[str],
    earlier: Commissioning | None = None,
    offers: Sequence[str] = (),
) -> Path:
    """Write the page of a record beside it and return its path.

    Args:
        folder: of commissioning.json.
        record: what stands in it.
        lacking: steps that do not count, in words.
        earlier: what it is drawn beside; None = nothing.
        offers: values of rig.toml that were measured otherwise, a sentence each.

    Raises:
        OSError: it cannot be written.
    """
    text = limit_html(_page(record, lacking, earlier, offers))
    with open_directory(folder) as directory:
        replace_file(directory, NAME, text.encode())
    return folder / NAME


def _page(
    record: Commissioning,
    lacking: Sequence[str],
    earlier: Commissioning | None,
    offers: Sequence[str],
) -> LimitPage:
    names = " and ".join(record.signed)
    last = record.steps[-1].ended if record.steps else None
    kind = "A simulated arm" if record.is_simulated else "This arm"
    signed = f"signed by {names}" if names else "not signed"
    beside = ""
    if earlier is not None and earlier.steps:
        beside = f"the commissioning of {earlier.steps[-1].ended:%Y-%m-%d %H:%M} UTC"
    return LimitPage(
        title="Commissioning",
        subtitle=f"{kind}, {record.program}, {signed}",
        is_simulated=record.is_simulated,
        written_utc=f"{last:%Y-%m-%d %H:%M} UTC" if last else "before any step",
        steps=[_step(done, earlier) for done in record.steps],
        missing=lacking,
        raw=[
            (done.step, raw.file, raw.sha256)
            for done in record.steps
            for raw in done.raw
        ],
        earlier=beside,
        offers=offers,
    )


def _step(done: StepRecord, earlier: Commissioning | None) -> LimitedStep:
    old = earlier.of(done.step, done.subject) if earlier is not None else None
    before = {each.name: each.value for each in old.quantities} if old else {}
    persons = " with ".join(name for name in (done.operator, done.witness) if name)
    words = f"{done.verdict}, {done.ended:%Y-%m-%d %H:%M} UTC, by {persons}."
    if done.accepted is not None:
        names, when = " and ".join(done.accepted.names), done.accepted.when
        words += f" Accepted by {names}, {when:%Y-%m-%d}: {done.accepted.reason}"
    return LimitedStep(
        done.name,
        f"{done.step}{done.subject}",
        [_value(each, before.get(each.name)) for each in done.quantities],
        f"{words} {done.cause}" if done.cause else words,
    )


def _value(each: Measured, before: float | None) -> LimitedValue:
    return LimitedValue(each.name, each.value, each.unit, each.low, each.high, before)
