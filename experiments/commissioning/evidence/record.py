"""commissioning.json: what each step measured, chained so that no line changes unseen.

The chain is evidence, not protection: who can write the file can write a whole new one.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from acquisition.errors import SettingsError
from acquisition.files import open_directory, read_regular, replace_file
from acquisition.formats import FORMAT
from acquisition.validation import Entries, Many, first_problem
from experiments.commissioning.evidence.order import ORDER, StepId

NAME = "commissioning.json"
_LARGEST = 4_000_000  # bytes
_FIRST = "0" * 64  # what the first step is chained to
_ANEW = "Put back the file as it was written, or do it again: traction commission."

Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Word = Annotated[str, Field(max_length=400)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Moment = Annotated[datetime, Field(strict=False)]  # in a table it is read from a text
Verdict = Literal["sound", "wrong"]


class RecordPart(BaseModel):
    """A part of a record: nothing else may stand in it, and it does not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Measured(RecordPart):
    """One quantity of a step beside its limits.

    Attributes:
        name: what was measured.
        value: of it, in `unit`.
        unit: "" = a number of something.
        low: the least that passes; None = no such limit.
        high: the most that passes; None = no such limit.
    """

    name: Word
    value: Number
    unit: Word
    low: Number | None = None
    high: Number | None = None

    @property
    def is_within(self) -> bool:
        """Whether it passes."""
        return (self.low is None or self.value >= self.low) and (
            self.high is None or self.value <= self.high
        )

    @property
    def text(self) -> str:
        """It in words, with the limit that it passed or did not."""
        unit = f" {self.unit}" if self.unit else ""
        limits = [
            f"{word} {limit:g}"
            for word, limit in (("at least", self.low), ("at most", self.high))
            if limit is not None
        ]
        bounds = f" ({' and '.join(limits)})" if limits else ""
        return f"{self.name} {self.value:.4g}{unit}{bounds}"


class Raw(RecordPart):
    """A recording that a step was judged by.

    Attributes:
        file: its name beside commissioning.json.
        sha256: of its bytes.
    """

    file: Annotated[str, Field(pattern=r"^[\w-][\w.-]{0,99}$")]
    sha256: Digest


class StepRecord(RecordPart):
    """One step that was done.

    Attributes:
        step: which.
        subject: what of several it was done with, e.g. the terrain of a container; "" =
            there is one only.
        started: UTC.
        ended: UTC.
        operator: who did it.
        inputs: digests of what it stands on, by the names of `order.BASES`.
        raw: what was recorded.
        quantities: what came of it.
        verdict: "wrong" = a quantity is beyond its limits.
        cause: the first contradiction, in words; "" = none.
        digest: of all this and of the step before.
    """

    step: StepId
    subject: Word = ""
    started: datetime
    ended: datetime
    operator: Word
    inputs: Entries[Word, Digest]
    raw: Many[Raw] = ()
    quantities: Many[Measured] = ()
    verdict: Verdict
    cause: Word = ""
    digest: Digest = _FIRST

    @property
    def name(self) -> str:
        """What was done, in words."""
        of = f" of {self.subject}" if self.subject else ""
        return f"{self.step} {self.step.words}{of}"

    def chained(self, before: str) -> Self:
        """Return it with the digest that follows the digest `before`."""
        content = self.model_dump(mode="json", exclude={"digest"})
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(f"{before}{text}".encode()).hexdigest()
        return self.model_copy(update={"digest": digest})


class Commissioning(RecordPart):
    """All of it: every step once, in order, as it was done last; C13 of each terrain.

    Attributes:
        version: of the file.
        program: version that wrote it.
        is_simulated: the arm is.
        steps: what was done.
        told: when a person last said of a basis of `order.BASES` that it changed, UTC.
    """

    version: Literal["1.0"] = FORMAT
    program: Word
    is_simulated: bool = False
    steps: Many[StepRecord] = ()
    told: Entries[Word, Moment] = {}

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        places = [_place(done) for done in self.steps]
        if places != sorted(set(places)):
            raise ValueError("its steps are not in order, or one stands twice")
        return self

    def of(self, step: StepId, subject: str = "") -> StepRecord | None:
        """Return what was done of a step; None = nothing.

        Args:
            step: which.
            subject: with what of several; "" = whatever was last.
        """
        found = [
            done
            for done in self.steps
            if done.step is step and subject in ("", done.subject)
        ]
        return max(found, key=lambda done: done.ended, default=None)

    def with_step(self, done: StepRecord) -> Self:
        """Return it with a step in its place; the chain is made anew."""
        steps = [old for old in self.steps if _place(old) != _place(done)]
        steps = sorted([*steps, done], key=_place)
        chained = _chain(steps, self.told)
        return self.model_copy(update={"steps": chained})

    def with_told(self, name: str, when: datetime) -> Self:
        """Return it with what a person says of a basis; the chain is made anew."""
        told = {**self.told, name: when}
        return self.model_copy(update={"told": told, "steps": _chain(self.steps, told)})

    def told_inputs(self) -> dict[str, str]:
        """Return digests of what a person said, by the names of `order.BASES`."""
        return {name: _first({name: when}) for name, when in self.told.items()}

    def first_broken(self) -> StepId | None:
        """Return the first step whose digest is not that of what stands there."""
        pairs = zip(self.steps, _chain(self.steps, self.told), strict=True)
        return next((is_.step for is_, was in pairs if is_.digest != was.digest), None)


def _place(done: StepRecord) -> tuple[int, str]:
    """Return what the steps of a record are ordered by."""
    return ORDER.index(done.step), done.subject


def _chain(
    steps: Iterable[StepRecord], told: Mapping[str, datetime]
) -> tuple[StepRecord, ...]:
    before, chained = _first(told), list[StepRecord]()
    for done in steps:
        chained.append(done.chained(before))
        before = chained[-1].digest
    return tuple(chained)


def _first(told: Mapping[str, datetime]) -> str:
    """Return what the first step is chained to."""
    if not told:
        return _FIRST
    text = json.dumps({name: told[name].isoformat() for name in sorted(told)})
    return hashlib.sha256(text.encode()).hexdigest()


def read_commissioning(folder: Path) -> Commissioning | None:
    """Return what stands in `folder`; None = there is no such file.

    Raises:
        SettingsError: it cannot be read, is no such file, or was changed.
    """
    path = folder / NAME
    try:
        found = Commissioning.model_validate_json(read_regular(path, _LARGEST))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unreadable(path, error.strerror or str(error)) from error
    except ValueError as error:
        raise _unreadable(path, first_problem(error)) from error
    broken = found.first_broken()
    if broken is not None:
        raise SettingsError(
            f"{path} was changed at or before {broken} {broken.words}: its digest is "
            "not that of what stands there.",
            hint=_ANEW,
        )
    return found


def _unreadable(path: Path, why: str) -> SettingsError:
    return SettingsError(f"{path} cannot be read: {why}.", hint=_ANEW)


def write_commissioning(folder: Path, content: Commissioning) -> None:
    """Write it whole, or leave the earlier one.

    Raises:
        OSError: it cannot be written.
    """
    text = json.dumps(content.model_dump(mode="json"), indent=1) + "\n"
    with open_directory(folder) as directory:
        replace_file(directory, NAME, text.encode())
