"""Files and end conditions of one trial: header, truth, flight record."""

import json
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from acquisition.clock import utc_offset_ns
from acquisition.errors import TrialFileError
from acquisition.ipc.frame_ring import last_frames
from acquisition.recording.recorder import seal
from acquisition.trial_file.header import TrialHeader
from acquisition.trial_file.verify import VerifiedFile
from acquisition.trial_file.writer import FLIGHT_TOPICS, TRUTH_TOPICS, TrialWriter
from analysis.data.recorded_factors import tread_of
from experiments import provenance
from experiments.rig.rig import Rig
from experiments.session.sidecar import TIME_LIMIT, TrialName
from experiments.session.store import SessionFolder, iso_utc
from ft_sensor.calibration.files import payload_to_toml, terrain_to_toml
from wam.model.arm_model import urdf

AFTER_TRAVEL = 0.4  # recording continues this long after the foot has crossed [s]
FLIGHT_SECONDS = 2.0
PACE_SECONDS, PACE_LIMIT = 1.0, 0.2  # s, m/s


@dataclass(frozen=True, slots=True)
class SessionMetadata:
    """Metadata common to all trials of a session."""

    folder: SessionFolder
    operator: str
    seed: int | None
    provenance: dict[str, str]
    diff: str


def collect_metadata(
    folder: SessionFolder, operator: str, seed: int | None, devices: Mapping[str, str]
) -> SessionMetadata:
    """Collect the metadata of a session; calls git once."""
    details = provenance.collect()
    details.update(devices)
    return SessionMetadata(folder, operator, seed, details, provenance.diff_patch())


def trial_header(rig: Rig, details: SessionMetadata, name: TrialName) -> TrialHeader:
    """Return the header of a trial, complete before its first cycle."""
    row = rig.row
    offset, uncertainty = utc_offset_ns(rig.clock)
    assert rig.model.tool is not None
    trial = {
        "session": details.folder.id,
        "trial": name.kept,
        "attempt": str(name.attempt),
        "terrain": row.name,
        "incline_deg": repr(row.incline_deg),
        "stone_size": row.stones,
        "tread": tread_of(row.foot),
        "effective_mass_kg": repr(rig.settings.rig.control.virtual_mass),
        "foot_mass_kg": repr(rig.model.tool.foot.mass),
        "gravity_model": rig.settings.rig.gravity.model,
        "friction_compensation": repr(rig.settings.rig.friction.share),
        "operator": details.operator,
        "notes": "",
        "simulated": "true" if rig.is_simulated else "false",
        "seed": "" if details.seed is None else str(details.seed),
        "started_utc": iso_utc(rig.clock.utc_ns()),
        "tared_ns": str(rig.tared_ns),
        **_factor_metadata(rig),
    }
    terrain = {"stones": row.stones, "foot": row.foot}
    attachments = {
        "config.toml": rig.settings.rig_text,
        "matrix.toml": rig.settings.matrix_text,
        "arm_model.toml": rig.model.constants.text,
        "robot.urdf": urdf(rig.model.constants),
        "ft_calibration.toml": payload_to_toml(rig.tared, rig.model.tool.sole),
        "terrain.toml": terrain_to_toml(row.name, rig.frame, terrain),
        "diff.patch": details.diff,
    }
    attachments.update(rig.settings.calibrations)
    attachments.update(rig.calibrations.attachments())
    return TrialHeader(
        trial=trial,
        utc_offset_ns=offset,
        offset_uncertainty_ns=uncertainty,
        provenance={**details.provenance, **rig.backend.loop_client.device_metadata()},
        attachments={key: text.encode() for key, text in attachments.items()},
        robot_description=attachments["robot.urdf"],
    )


def _factor_metadata(rig: Rig) -> dict[str, str]:
    """Metadata of a cell of the matrix with factors; {} for a cell of the paper.

    {} = no factors, a push toward the base, and foot "tread" or "bare". `factors` is
    JSON: values by name, null = does not apply; `factor_units` their units,
    `factor_scales` the scales on which numbers are compared.
    """
    row, matrix = rig.row, rig.settings.matrix
    if not matrix.factors and row.push_deg == 0 and row.foot in ("tread", "bare"):
        return {}
    foot = rig.settings.rig.feet[row.foot]
    sole = {"foot_shape": foot.shape, "foot_area_m2": foot.area}
    units = {factor.name: factor.unit for factor in matrix.factors}
    scales = {f.name: f.scale for f in matrix.factors if f.kind == "number"}
    return {
        "foot": row.foot,
        "push_deg": str(row.push_deg),
        "factors": json.dumps(row.factors, sort_keys=True),
        "factor_units": json.dumps(units, sort_keys=True),
        "factor_scales": json.dumps(scales, sort_keys=True),
        **{name: str(value) for name, value in sole.items() if value is not None},
    }


@dataclass(slots=True)
class EndDetector:
    """Detects the end of a running trial from time and travel.

    Attributes:
        travel: length of the container [m].
        crossed_at: time at which the foot had crossed it [s since start], None before.
    """

    travel: float
    crossed_at: float | None = None

    def reason(self, elapsed: float, displacement: float) -> str:
        """Return the reason to end the trial now, "" while it continues."""
        if self.crossed_at is None and displacement >= self.travel:
            self.crossed_at = elapsed
        if self.crossed_at is not None and elapsed >= self.crossed_at + AFTER_TRAVEL:
            return "travel"
        return "time-limit" if elapsed >= TIME_LIMIT else ""


@dataclass(slots=True)
class PaceMonitor:
    """Detects a foot that is pushed too fast, as distinct from a slip.

    A slip is over after centimetres; a second at 0.2 m/s is a push without the sticking
    phases that the friction models need.
    """

    _path: deque[tuple[float, float]] = field(
        default_factory=deque[tuple[float, float]]
    )

    def is_too_fast(self, elapsed: float, displacement: float) -> bool:
        """Return whether the last second was too fast; at most once a second.

        Args:
            elapsed: time since the start of the trial [s], increasing.
            displacement: displacement of the foot along the container [m].
        """
        path = self._path
        path.append((elapsed, displacement))
        while elapsed - path[0][0] > PACE_SECONDS:
            start = path.popleft()
            if displacement - start[1] > PACE_LIMIT * (elapsed - start[0]):
                path.clear()
                return True
        return False


def write_truth(rig: Rig, header: TrialHeader, path: Path) -> VerifiedFile | None:
    """Write the truth of a simulated trial alongside it; None on the real rig."""
    if rig.simulation is None:
        return None
    records = rig.simulation.take_truth()
    if len(records) < 2:
        return None
    parameters = {f"true:{k}": v for k, v in rig.simulation.parameters().items()}
    truth_header = TrialHeader(
        trial={**header.trial, **parameters},
        utc_offset_ns=header.utc_offset_ns,
        offset_uncertainty_ns=header.offset_uncertainty_ns,
        provenance=header.provenance,
        attachments=header.attachments,
        robot_description="",
    )
    writer = TrialWriter(path, truth_header, TRUTH_TOPICS)
    writer.write_truth(records)
    return seal(writer, "simulation")


def write_flight(rig: Rig, header: TrialHeader, path: Path, reason: str) -> None:
    """Write the last two seconds with raw frames after a fault."""
    writer = TrialWriter(path, header, FLIGHT_TOPICS)
    writer.write_cycles(rig.backend.loop_client.last(FLIGHT_SECONDS))
    writer.write_can(last_frames(rig.shared.frames, FLIGHT_SECONDS))
    writer.write_event(rig.clock.now_ns(), 40, "fault", reason)
    seal(writer, reason)


@dataclass(frozen=True, slots=True)
class TrialArchive:
    """The files of one session's trials."""

    rig: Rig
    metadata: SessionMetadata

    def seal(self, header: TrialHeader, name: TrialName, reason: str) -> VerifiedFile:
        """Complete and verify the trial file, and the truth file if simulated.

        Raises:
            TrialFileError: a file could not be written or verified.
        """
        verified = self.rig.backend.recorder.finish(reason)
        truth = self.metadata.folder.trials / f"{name.kept}.truth.mcap"
        write_truth(self.rig, header, truth)
        return verified

    def flight(self, header: TrialHeader, name: TrialName, reason: str) -> str:
        """Write the flight record of a fault; returns the line to print."""
        path = self.metadata.folder.faults / f"{name.rejected}.flight.mcap"
        try:
            write_flight(self.rig, header, path, reason)
        except TrialFileError as error:
            return f"No flight record: {error}"
        return f"Flight record: faults/{path.name}."
