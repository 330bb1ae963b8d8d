"""What a person states of a log: everything that changes a number of its trials."""

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
    """What is stated.

    Attributes:
        log: file or folder.
        urdf: of the robot.
        foot: link of the URDF, the centre of the sole.
        sensor: link of the URDF in whose axes the wrench is.
        acts: what the numbers of the wrench are.
        tare: (start, end) [s of the log] in which the foot is free, six numbers
            [N, N m], or "none" for a sensor that is tared.
        mass: of everything below the gauges [kg].
        along: direction of the slip in the base, shape (3,).
        normal: of the ground in the base, shape (3,).
        lag: how late the wrench is stamped against the joints [s].
        trials: (start, end) [s of the log], a trial each.
        joints: topic; None = the only one.
        wrench: topic; None = the only one.
        clock: "stamp" or "receipt"; None = stamps, refused where they disagree with
            the recorder's clock.
        terrain: name of the terrain.
        factors: what else is known of terrain and foot, by name.
        is_slow: rates below 50 Hz are taken.
        is_estimated: the wrench is not measured but estimated by the robot.
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
        """+1 where the numbers of the wrench are the ground's force on the foot."""
        return 1.0 if self.acts == "ground-on-foot" else -1.0
