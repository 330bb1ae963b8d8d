"""The foot as a key: a double tap, seen in the newest samples of the loop."""

from experiments.operator.double_tap import DoubleTap
from experiments.rig.rig import Rig

_SECONDS = 0.1  # of samples looked at; those seen before are passed over


class FootKeys:
    """Turns a double tap of the foot into a key, if rig.toml wants it."""

    def __init__(self, rig: Rig) -> None:
        is_wanted = rig.settings.rig.operator.double_tap
        self._taps = DoubleTap() if is_wanted else None
        self._desk = rig.crew.desk

    def key(self, key: str) -> str:
        """Return `key` when the foot was tapped twice since the last call, else ""."""
        if self._taps is None:
            return ""
        records = self._desk.last(_SECONDS)
        t = records["host_ns"].astype(float) * 1e-9
        v_t, _, F_n = records["traction"].T
        return key if self._taps.feed(t, F_n, v_t) else ""
