"""What a session of stances was asked for, and what came of its stances so far.

Such a session has a file `stance.json`; its trials keep their stances in their sidecars
and in the events of the recording. The study of pushes leaves it out.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from acquisition.errors import SessionError, SettingsError
from analysis.breakaway.pushes import FootPush
from analysis.stance.interface import StanceRequest
from analysis.stance.outcomes import StanceOutcome, adapted
from analysis.stance.policies import POLICIES
from analysis.stance.sequence import LEAST_TRAVEL
from experiments.arguments import did_you_mean
from experiments.session.data_files import read_json, write_json
from experiments.session.store import STANCE_FILE, SessionFolder, list_sessions
from experiments.session.trial_files import kept_sidecars

_MOST = 99


@dataclass(frozen=True, slots=True)
class StanceTask:
    """What a session of stances is asked for.

    Attributes:
        policy: name of the policy.
        risk: share of stances that may slip.
        peak: of the force asked for [N].
        count: stances of a recording.
    """

    policy: str
    risk: float
    peak: float
    count: int

    def __post_init__(self) -> None:
        """Refuse what cannot be asked.

        Raises:
            SettingsError: no such policy, or a number is out of its range.
        """
        if self.policy not in POLICIES:
            known = sorted(POLICIES)
            raise SettingsError(
                f"--policy {self.policy!r} - expected one of {', '.join(known)}.",
                hint=f"{did_you_mean(self.policy, known)} Nothing was started.".strip(),
            )
        if not 1 <= self.count <= _MOST:
            raise SettingsError(
                f"--stances {self.count} - expected a whole number 1..{_MOST}, "
                "e.g. 25.",
                hint="Nothing was started.",
            )
        _ = self.request

    @property
    def request(self) -> StanceRequest:
        """What is asked of every stance."""
        return StanceRequest(self.peak, self.risk)

    def check_travel(self, terrain: str, travel: float) -> None:
        """Refuse a container of `travel` [m] without fresh places.

        Raises:
            SettingsError: it is too short.
        """
        if travel < LEAST_TRAVEL:
            raise SettingsError(
                f"{terrain}: a container of {travel:g} m has no fresh place for each "
                f"of {self.count} stances; {LEAST_TRAVEL:g} m are needed.",
                hint="Correct travel in matrix.toml. Nothing was started.",
            )

    @property
    def is_foreseen(self) -> bool:
        """Whether the policy needs to know the risk."""
        return self.policy == "avoid-slip"

    @property
    def name(self) -> str:
        """Policy, with its risk where it has one, and the force asked for."""
        risk = f" {self.risk:g}" if self.is_foreseen else ""
        return f"{self.policy}{risk}, {self.peak:g} N"

    @property
    def text(self) -> str:
        """The task in words."""
        return f"{self.count} stances a recording: {self.name}"

    def metadata(self) -> dict[str, str]:
        """Return what a trial states of it."""
        return {
            "task": "stance",
            "stance_policy": self.policy,
            "stance_risk": repr(self.risk),
            "stance_peak": repr(self.peak),
        }

    def write(self, folder: SessionFolder) -> None:
        """Write the task into the folder of its session."""
        write_json(folder.path / STANCE_FILE, asdict(self))


def read_stance_task(folder: SessionFolder) -> StanceTask | None:
    """Return the task of a session of stances, None for one of pushes.

    Raises:
        SessionError: the file is none that this program wrote.
    """
    if not folder.is_of_stances:
        return None
    fields = read_json(folder.path / STANCE_FILE)
    try:
        return StanceTask(
            policy=str(fields["policy"]),
            risk=float(fields["risk"]),
            peak=float(fields["peak"]),
            count=int(fields["count"]),
        )
    except (KeyError, TypeError, ValueError, SettingsError) as error:
        raise SessionError(
            f"{folder.id}: {STANCE_FILE} holds no task ({error}).",
            hint="Take the file from a copy of the session. Nothing was changed.",
        ) from error


def stance_outcomes(folder: SessionFolder) -> list[tuple[str, list[StanceOutcome]]]:
    """Return the stances of the kept trials of a session, trial by trial.

    Raises:
        SessionError: a sidecar does not hold what this program wrote.
    """
    found: list[tuple[str, list[StanceOutcome]]] = []
    for sidecar in kept_sidecars(folder):
        name, rows = str(sidecar.get("trial", "?")), sidecar.get("stances", [])
        try:
            found.append((name, [StanceOutcome.from_dict(row) for row in _rows(rows)]))
        except (KeyError, TypeError, ValueError) as error:
            raise SessionError(
                f"{folder.id} {name}: the sidecar holds no stances ({error!r}).",
                hint="Take the file from a copy of the session. Nothing was changed.",
            ) from error
    return found


def stance_pushes(
    data: Path, *, but: SessionFolder | None = None
) -> dict[str, list[list[FootPush]]]:
    """Return what kept stances below `data` taught of fresh places, by terrain.

    Trial by trial; simulated ones only, there are no others.

    Args:
        data: the data folder.
        but: a session that is left out.

    Raises:
        SessionError: as `stance_outcomes`.
    """
    pushes: dict[str, list[list[FootPush]]] = {}
    for session in list_sessions(data):
        if session == but or not (session.is_of_stances and session.is_simulated):
            continue
        for _, outcomes in stance_outcomes(session):
            taught = [p for one in outcomes if (p := one.push) is not None]
            pushes.setdefault(session.terrain, []).append(taught)
    return pushes


def _rows(rows: Any) -> Sequence[Any]:  # noqa: ANN401
    if not isinstance(rows, list):
        raise TypeError("no list")
    return rows  # pyright: ignore[reportUnknownVariableType]


def adapted_scale(first: float, folder: SessionFolder) -> float:
    """Return the scale that the kept stances of a session have led to.

    Args:
        first: the scale before the first of them.
        folder: of the session.
    """
    scale = first
    for _, outcomes in stance_outcomes(folder):
        for outcome in outcomes:
            scale = adapted(scale, outcome)
    return scale
