"""User input of an import: everything that affects the numbers of its trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from analysis.data.series import Array
from analysis.data.terrain_kinds import Value
from analysis.logs.channels import By

Acts = Literal["ground-on-foot", "foot-on-ground"]
Tare = tuple[float, float] | Array | Literal["none"]


@dataclass(frozen=True, slots=True)
class ImportRequest:
    """User input of an import.

    Attributes:
        log: log file or folder.
        urdf: URDF of the robot.
        foot: URDF link at the centre of the sole.
        sensor: URDF link in whose axes the wrench is given.
        acts: sign convention of the wrench.
        tare: (start, end) [s of the log] in which the foot is free, six numbers
            [N, N m], or "none" for a tared sensor.
        mass: mass of everything below the gauges [kg].
        along: direction of the slip in the base frame, shape (3,).
        normal: normal of the ground in the base frame, shape (3,).
        lag: lag of the wrench stamps relative to the joints [s].
        trials: (start, end) [s of the log] of every trial.
        joints: topic of the joints; None = the only one.
        wrench: topic of the wrench; None = the only one.
        clock: "stamp" or "receipt"; None = stamps, refused if they disagree with the
            recorder's clock.
        terrain: name of the terrain.
        factors: further properties of terrain and foot by name.
        is_slow: accept rates below 50 Hz.
        is_estimated: the wrench is estimated by the robot, not measured.
    """

    log: Path
    urdf: Path
    foot: str
    sensor: str
    acts: Acts
    tare: Tare
    mass: float
    along: Array
    normal: Array
    lag: float
    trials: Sequence[tuple[float, float]]
    joints: str | None = None
    wrench: str | None = None
    clock: By | None = None
    terrain: str = "table"
    factors: Mapping[str, Value] = field(default_factory=dict[str, Value])
    is_slow: bool = False
    is_estimated: bool = False

    @property
    def sign(self) -> float:
        """+1 if the wrench is the ground's force on the foot, otherwise -1."""
        return 1.0 if self.acts == "ground-on-foot" else -1.0
