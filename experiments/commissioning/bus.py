"""C1 to C3: devices on the bus, their identity and the timing of their replies."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict

import numpy as np

from acquisition.errors import TractionError, UnfitDeviceError
from acquisition.sample import Flag
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.judging import Judgement, judge_quantity, judged
from experiments.commissioning.recording import Values, number, texts, words
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from experiments.rig.build import read_properties
from experiments.rig.requests import (
    CountAnswers,
    LastAnswers,
    Listen,
    MeasureExchange,
    OpenSensor,
    StartArm,
)
from experiments.rig.rig import Rig
from wam.bus.frames import MOTOR_NODES, SAFETY_NODE
from wam.driver.puck_properties import (
    compare,
    known_table,
    shipped_table,
)

LISTEN_SECONDS = 10.0  # s, duration of C1
_PORTION = 0.5  # s, period of the progress bar
ASKED = 3  # requests for the same property, to find duplicate nodes
LOOP_SECONDS = 60  # s, duration of the loop in C3
IDLE_DEGREES = (10.0, 50.0)  # °C
_SILENT = -(2**31)  # stands for a property without a reply


def listen(rig: Rig, most: float = LISTEN_SECONDS) -> Iterator[tuple[float, Values]]:
    """Listen silently for `most` [s]; yields progress and the recording."""
    frames, seconds = 0, 0.0
    while seconds < most:
        heard = rig.backend.ask(Listen(_PORTION))
        seconds += _PORTION
        frames += heard.frames
        yield (
            seconds / most,
            {
                "seconds": np.array(seconds),
                "frames": np.array(frames),
                "master": np.array(-1 if heard.master is None else heard.master),
                "error_frames": np.array(heard.error_frames),
            },
        )


def judge_silence(values: Values) -> Judgement:
    """Judge a recording of `listen`."""
    master = int(values["master"])
    return judged(
        [
            judge_quantity("masters", int(master >= 0), id=max(master, 0)),
            judge_quantity("error_frames", number(values, "error_frames")),
            judge_quantity("frames", number(values, "frames")),
            judge_quantity("listened", number(values, "seconds")),
        ]
    )


def identify(rig: Rig, commissioned: Sequence[int | None] = ()) -> Values:
    """Read the identity of every device, even if the start refuses it.

    Args:
        rig: rig with an open bus.
        commissioned: serial numbers of pucks 1 to 7 when C2 was last sound; () = never.
    """
    refusal, warnings, nodes = "", list[str](), list[int]()
    degrees = np.full((2, len(MOTOR_NODES)), np.nan)  # of pucks, of motors
    try:
        info = rig.backend.ask(StartArm())
        warnings, nodes = list(info.warnings), list(info.nodes)
        for i, puck in enumerate(info.pucks):
            reported = (puck.health.puck_degc, puck.health.motor_degc)
            degrees[:, i] = [np.nan if value is None else value for value in reported]
    except TractionError as error:
        refusal = error.message
        if not isinstance(error, UnfitDeviceError):
            refusal = str(error)
    answers = rig.backend.ask(LastAnswers())
    names = sorted({name for answer in answers for name in answer})
    rows = [[answer.get(name) for name in names] for answer in answers]
    table = [[_SILENT if value is None else value for value in row] for row in rows]
    reply_counts = asdict(rig.backend.ask(CountAnswers(ASKED)))
    return {
        "names": texts(names),
        "properties": np.array(table, dtype=np.int64).reshape(len(answers), len(names)),
        "nodes": np.array(nodes, dtype=np.int64),
        "asked": np.array(reply_counts["nodes"], dtype=np.int64),
        "answers": np.array(reply_counts["counts"], dtype=np.int64),
        "differing": np.array(reply_counts["differing"], dtype=np.int64),
        "warnings": texts(warnings),
        "refusal": texts([refusal] if refusal else []),
        "degrees": degrees,
        "expected": texts([_expected(rig)]),
        "commissioned": np.array(
            [_SILENT if serial is None else serial for serial in commissioned],
            dtype=np.int64,
        ),
    }


def _expected(rig: Rig) -> str:
    """Return the property table of this arm, "" for the factory's."""
    return "" if rig.is_simulated else read_properties(rig.settings)


def reported_properties(values: Values) -> dict[str, list[int | None]]:
    """Return the properties of the seven pucks by name; None = no reply."""
    rows = values["properties"].tolist()
    return {
        name: [None if row[i] == _SILENT else int(row[i]) for row in rows]
        for i, name in enumerate(words(values, "names"))
    }


def serials_of(values: Values) -> list[int | None]:
    """Return the serial numbers of pucks 1 to 7; [] = not read."""
    return reported_properties(values).get("SN", [])


def commissioned_with(values: Values) -> list[int | None]:
    """Return the serial numbers when C2 was last sound; [] = never."""
    stored = values["commissioned"].tolist()
    return [None if serial == _SILENT else int(serial) for serial in stored]


def _replaced(values: Values) -> list[str]:
    """Describe the pucks that were replaced since the commissioning."""
    pairs = zip(serials_of(values), commissioned_with(values), strict=False)
    return [
        f"SN of puck {node} is {now}, it was {before}"
        for node, (now, before) in enumerate(pairs, 1)
        if None not in (now, before) and now != before
    ]


def _temperatures(values: Values) -> list[str]:
    """Describe the pucks and motors outside the temperatures of idle ones."""
    low, high = IDLE_DEGREES
    return [
        f"{what} {node} has {degrees:.0f} °C, an idle one has {low:g} to {high:g}"
        for what, row in zip(("puck", "motor"), values["degrees"].tolist(), strict=True)
        for node, degrees in enumerate(row, 1)
        if degrees < low or degrees > high
    ]


def judge_identity(values: Values) -> Judgement:
    """Judge a recording of `identify`."""
    counts = dict(
        zip(values["asked"].tolist(), values["answers"].tolist(), strict=True)
    )
    motors = [counts.get(node, 0) for node in MOTOR_NODES]
    properties = reported_properties(values)
    complete = len(values["properties"]) == len(MOTOR_NODES)
    (table_text,) = words(values, "expected")
    table = (
        known_table(table_text, "[arm] properties") if table_text else shipped_table()
    )
    differences = compare(table, properties) if complete else []
    severe = [diff.text for diff in differences if not diff.is_warning]
    ignored = [text for text in words(values, "warnings") if "safety module" in text]
    refusal, replaced = words(values, "refusal"), _replaced(values)
    serials = [serial for serial in properties.get("SN", []) if serial is not None]
    rows = [
        judge_quantity("module", int(counts.get(SAFETY_NODE, 0) > 0)),
        judge_quantity("nodes", sum(count > 0 for count in motors)),
        judge_quantity("twice", max(*counts.values(), 0)),
        judge_quantity("properties", len(severe), text="; ".join(severe)),
        judge_quantity("replaced", len(replaced), text="; ".join(replaced)),
        judge_quantity("module_limits", len(ignored), text=" ".join(ignored)),
        judge_quantity("refused", len(refusal), text=" ".join(refusal)),
    ]
    if complete and len(serials) == len(MOTOR_NODES):
        rows.append(judge_quantity("serials", len(set(serials))))
    advice = [diff.text for diff in differences if diff.is_warning]
    return judged(rows, [*advice, *_temperatures(values)])


def time_replies(rig: Rig) -> Iterator[tuple[float, Values]]:
    """Time position requests, omit some, then run the loop with the arm idle."""
    measured = rig.backend.ask(MeasureExchange())
    rig.backend.ask(OpenSensor())
    rig.backend.begin()
    loop_client = rig.backend.loop_client
    reader = rig.shared.cycles.reader()
    cycles = incomplete = 0
    for second in range(1, LOOP_SECONDS + 1):
        loop_client.advance(1.0)
        flags = reader.read()["flags"]
        cycles += len(flags)
        incomplete += int((flags & (Flag.ARM_FRESH | Flag.ARM_UNASKED) == 0).sum())
        yield (
            second / LOOP_SECONDS,
            {
                "replies_ns": np.array(measured.replies_ns, dtype=np.int64),
                "unasked": np.array(measured.unasked),
                "late": np.array(measured.late),
                "age_ns": np.array(measured.age_ns),
                "answer_ns": np.array(measured.answer_ns),
                "jumps": np.array(measured.jumps),
                "cycles": np.array(cycles),
                "incomplete": np.array(incomplete),
            },
        )


def judge_timing(values: Values) -> Judgement:
    """Judge a recording of `time_replies`."""
    return judged(
        [
            judge_quantity("answered", number(values, "unasked")),
            judge_quantity("late", number(values, "late")),
            judge_quantity("jumps", number(values, "jumps")),
            judge_quantity("answer", number(values, "answer_ns") / 1e6),
            judge_quantity("cycles", number(values, "cycles")),
            judge_quantity("incomplete", number(values, "incomplete")),
        ]
    )


def _collect_silence(scene: Scene) -> Values:
    return scene.show(listen(scene.rig), "listening, nothing is sent")


def _collect_identity(scene: Scene) -> Values:
    values = identify(scene.rig, scene.serials)
    scene.answers = scene.rig.backend.ask(LastAnswers())
    return values


def _collect_times(scene: Scene) -> Values:
    if scene.info is None:
        scene.info = scene.rig.backend.ask(StartArm())
        scene.answers = scene.rig.backend.ask(LastAnswers())
    return scene.show(time_replies(scene.rig), "the loop runs, the arm idle")


LISTEN = Step(
    StepId.LISTEN,
    _collect_silence,
    judge_silence,
    minutes=1,
    remedy="End the other program; look at cable, terminators and bit rate.",
)
IDENTITY = Step(
    StepId.IDENTITY,
    _collect_identity,
    judge_identity,
    minutes=1,
    remedy="Is this the arm and the puck it should be? What is right as it is goes "
    "into the file that [arm] properties of rig.toml names. Where a puck was replaced, "
    "move commissioning.json away: every step is done again.",
)
TIMING = Step(
    StepId.TIMING,
    _collect_times,
    judge_timing,
    minutes=2,
    remedy="Use another adapter or computer, and end other programs on the bus.",
)
