"""commissioning.json: results of the steps, chained so that any change shows.

The chain is evidence, not protection: whoever can write the file can rewrite it all.
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
FIELD = "commissioning"  # in the metadata of a recording
COMPLETE = "complete"  # value of a complete commissioning
_LARGEST = 4_000_000  # bytes
_FIRST = "0" * 64  # digest before the first step
_ANEW = "Put back the file as it was written, or do it again: traction commission."

Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Word = Annotated[str, Field(max_length=400)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Moment = Annotated[datetime, Field(strict=False)]  # parsed from text
Verdict = Literal["sound", "wrong"]


class RecordPart(BaseModel):
    """A part of a record: immutable, without unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Measured(RecordPart):
    """One quantity of a step with its limits.

    Attributes:
        name: name of the quantity.
        value: value in `unit`.
        unit: unit; "" = a count.
        low: lower limit; None = no such limit.
        high: upper limit; None = no such limit.
    """

    name: Word
    value: Number
    unit: Word
    low: Number | None = None
    high: Number | None = None

    @property
    def is_within(self) -> bool:
        """Whether the value is within its limits."""
        return (self.low is None or self.value >= self.low) and (
            self.high is None or self.value <= self.high
        )

    @property
    def text(self) -> str:
        """The quantity as text, with its limits."""
        unit = f" {self.unit}" if self.unit else ""
        limits = [
            f"{word} {limit:g}"
            for word, limit in (("at least", self.low), ("at most", self.high))
            if limit is not None
        ]
        bounds = f" ({' and '.join(limits)})" if limits else ""
        return f"{self.name} {self.value:.4g}{unit}{bounds}"


class Raw(RecordPart):
    """The recording that a step was judged by.

    Attributes:
        file: file name, in the folder of commissioning.json.
        sha256: checksum of the file.
    """

    file: Annotated[str, Field(pattern=r"^[\w-][\w.-]{0,99}$")]
    sha256: Digest


class StepRecord(RecordPart):
    """Record of one step.

    Attributes:
        step: the step.
        subject: one of several, e.g. the terrain of a container; "" = there is only
            one.
        started: UTC.
        ended: UTC.
        operator: name of the operator.
        inputs: digests of its inputs, by the names of `order.STEP_INPUTS`.
        raw: its recordings.
        quantities: its results.
        verdict: "wrong" = a quantity is beyond its limits.
        cause: the first contradiction; "" = none.
        digest: digest of all this and of the previous step.
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
        """Name of the step with its subject."""
        of = f" of {self.subject}" if self.subject else ""
        return f"{self.step} {self.step.words}{of}"

    def chained(self, before: str) -> Self:
        """Return the step with the digest that follows the digest `before`."""
        content = self.model_dump(mode="json", exclude={"digest"})
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(f"{before}{text}".encode()).hexdigest()
        return self.model_copy(update={"digest": digest})


class Commissioning(RecordPart):
    """The commissioning: the last record of every step, in order; C13 per terrain.

    Attributes:
        version: version of the file format.
        program: version of the program that wrote it.
        is_simulated: whether the arm is simulated.
        steps: records of the steps.
        told: time [UTC] at which a person last reported a change of an input, by name.
    """

    version: Literal["1.0"] = FORMAT
    program: Word
    is_simulated: bool = False
    steps: Many[StepRecord] = ()
    told: Entries[Word, Moment] = {}

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        keys = [_sort_key(done) for done in self.steps]
        if keys != sorted(set(keys)):
            raise ValueError("its steps are not in order, or one stands twice")
        return self

    def of(self, step: StepId, subject: str = "") -> StepRecord | None:
        """Return the last record of a step, or None.

        Args:
            step: the step.
            subject: one of several; "" = any.
        """
        records = [
            done
            for done in self.steps
            if done.step is step and subject in ("", done.subject)
        ]
        return max(records, key=lambda done: done.ended, default=None)

    def with_step(self, done: StepRecord) -> Self:
        """Return the commissioning with a step inserted or replaced, chained again."""
        steps = [old for old in self.steps if _sort_key(old) != _sort_key(done)]
        steps = sorted([*steps, done], key=_sort_key)
        chained = _chain(steps, self.told)
        return self.model_copy(update={"steps": chained})

    def with_reported_change(self, name: str, when: datetime) -> Self:
        """Return the commissioning with a reported change, chained again."""
        told = {**self.told, name: when}
        return self.model_copy(update={"told": told, "steps": _chain(self.steps, told)})

    def reported_inputs(self) -> dict[str, str]:
        """Digests of the reported changes, by the names of `order.STEP_INPUTS`."""
        return {name: _initial_digest({name: when}) for name, when in self.told.items()}

    def first_broken(self) -> StepId | None:
        """Return the first step whose digest does not match its content, or None."""
        pairs = zip(self.steps, _chain(self.steps, self.told), strict=True)
        return next(
            (s.step for s, expected in pairs if s.digest != expected.digest), None
        )


def _sort_key(done: StepRecord) -> tuple[int, str]:
    """Sort key of the steps of a record."""
    return ORDER.index(done.step), done.subject


def _chain(
    steps: Iterable[StepRecord], told: Mapping[str, datetime]
) -> tuple[StepRecord, ...]:
    before, chained = _initial_digest(told), list[StepRecord]()
    for done in steps:
        chained.append(done.chained(before))
        before = chained[-1].digest
    return tuple(chained)


def _initial_digest(told: Mapping[str, datetime]) -> str:
    """Digest that the first step is chained to."""
    if not told:
        return _FIRST
    text = json.dumps({name: told[name].isoformat() for name in sorted(told)})
    return hashlib.sha256(text.encode()).hexdigest()


def read_commissioning(folder: Path) -> Commissioning | None:
    """Read the commissioning in `folder`; None = there is no such file.

    Raises:
        SettingsError: the file cannot be read, is invalid, or was changed.
    """
    path = folder / NAME
    try:
        record = Commissioning.model_validate_json(read_regular(path, _LARGEST))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unreadable(path, error.strerror or str(error)) from error
    except ValueError as error:
        raise _unreadable(path, first_problem(error)) from error
    broken = record.first_broken()
    if broken is not None:
        raise SettingsError(
            f"{path} was changed at or before {broken} {broken.words}: its digest is "
            "not that of what stands there.",
            hint=_ANEW,
        )
    return record


def _unreadable(path: Path, why: str) -> SettingsError:
    return SettingsError(f"{path} cannot be read: {why}.", hint=_ANEW)


def write_commissioning(folder: Path, content: Commissioning) -> None:
    """Replace the commissioning atomically.

    Raises:
        OSError: the file cannot be written.
    """
    text = json.dumps(content.model_dump(mode="json"), indent=1) + "\n"
    with open_directory(folder) as directory:
        replace_file(directory, NAME, text.encode())
