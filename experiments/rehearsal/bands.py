"""The bands that a simulated study has to meet, as data.

Each band corresponds to a statement of the paper or an implication of its models; they
were set on simulations of another program. A measure may have several values, one per
terrain or cell; all must be inside.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

_ROUNDING = 1e-9  # tolerance for a share of exactly 1


@dataclass(frozen=True, slots=True)
class Band:
    """Permitted range of one measure.

    Attributes:
        id: letter of the group and number.
        what: description of the measure.
        least: smallest value allowed.
        most: largest value allowed.
    """

    id: str
    what: str
    least: float
    most: float


@dataclass(frozen=True, slots=True)
class BandResult:
    """One measure with its band.

    Attributes:
        band: the band.
        values: measured values; empty if not measurable.
    """

    band: Band
    values: tuple[float, ...]

    @property
    def is_met(self) -> bool:
        """Whether there is a value and every one is inside."""
        band = self.band
        return bool(self.values) and all(
            band.least - _ROUNDING <= value <= band.most + _ROUNDING
            for value in self.values
        )

    @property
    def text(self) -> str:
        """The values as text: one, or smallest and largest."""
        if not self.values:
            return "none"
        low, high = min(self.values), max(self.values)
        return f"{low:.3g}" if len(self.values) == 1 else f"{low:.3g} .. {high:.3g}"


BANDS = (
    Band("A1", "own MAE on TF and Tf, Tustin and GP (N)", 0.15, 0.75),
    Band("A2", "mean of those four (N)", 0.2, 0.6),
    Band("A3", "own MAE of each stone terrain / A2", 3.0, 18.0),
    Band("A4", "own GP MAE, mean of six stone terrains (N)", 1.4, 4.2),
    Band("A5", "|Tustin - GP| / GP own MAE, each terrain", 0.0, 0.25),
    Band("A6", "R2 of GP on held-out trials, mean of stones", 0.2, 0.7),
    Band("B1", "stone model on other stone / own, every cell", 0.8, 1.5),
    Band("B2", "the same, mean", 0.9, 1.15),
    Band("B3", "TF model on stones / own, GP, mean of six", 1.12, 1.8),
    Band("B4", "Tf model on stones / own, GP, mean of six", 1.35, 2.4),
    Band("B5", "flat model on each stone terrain / on its own plate", 3.0, 40.0),
    Band("B6", "stone model on TF / TF own, GP, every cell", 1.4, 12.0),
    Band("B7", "stone model on Tf / Tf own, GP, every cell", 2.8, 30.0),
    Band("B8", "share of trials whose best model is of the right class", 0.85, 1.0),
    Band("B9", "share of trials whose best model is exactly right", 0.15, 0.65),
    Band("B10", "flat/stone cells worse than own, Wilcoxon p < 0.05, GP", 21, 24),
    Band("C1", "GP predictive variance, smallest stone / largest flat", 6.0, 200.0),
    Band("C2", "GP 95 % coverage on held-out trials, each stone", 0.86, 0.98),
    Band("C3", "autocorrelation of GP residual at 10 ms, stones", 0.85, 0.995),
    Band("C4", "the same at 50 ms, mean", 0.5, 0.9),
    Band("D1", "slips per trial, each stone terrain", 2.5, 13.0),
    Band("D2", "slips per trial, each plate", 0.0, 1.0),
    Band("D3", "F_t floor in slip / peak before, median", -0.1, 0.25),
    Band("D4", "share of slips whose floor is < 30 % of the peak", 0.8, 1.0),
    Band("D5", "share of slips followed by v_t < -0.01 m/s", 0.2, 0.9),
    Band("D6", "force spike at re-sticking / peak before, median", 0.2, 0.8),
    Band("D7", "share of slips preceded by a sag of F_t >= 8 %", 0.08, 0.6),
    Band("D8", "CV of peak F_t before slip, pooled", 0.2, 0.6),
    Band("D9", "CV of slip length, pooled", 0.2, 0.8),
    Band("D10", "median peak v_t of slips (m/s)", 0.14, 0.3),
    Band("E1", "share of moving samples inside the window, each", 0.75, 1.0),
    Band("E2", "share of sticking samples, each stone", 0.12, 0.6),
    Band("E3", "share with v_t < -0.005 m/s, each stone", 0.008, 0.09),
    Band("E4", "the same, each plate", 0.0, 0.005),
    Band("E5", "corr(F_t, v_t), each stone", -0.6, -0.2),
    Band("E6", "corr(F_t, F_n), mean of stones", 0.3, 0.8),
    Band("E7", "median Tustin b, each stone (kg/s)", -80.0, -2.0),
    Band("E8", "mean F_n, each terrain (N)", 1.5, 7.0),
    Band("E9", "99th percentile of F_t, each stone (N)", 9.0, 36.0),
    Band("E10", "trial duration, each terrain's mean (s)", 6.0, 25.0),
    Band("E11", "kept samples, smallest trial", 250, 4000),
    Band("F1", "white noise of raw F_t at rest (N)", 0.2, 0.45),
    Band("F2", "sd over plate trials of mean F_t at rest (N)", 0.12, 0.65),
)


def compare_with_bands(measures: Mapping[str, Sequence[float]]) -> list[BandResult]:
    """Return every band with its measured values, in order.

    Args:
        measures: values by the id of the band; a missing one is not met.
    """
    return [BandResult(band, tuple(measures.get(band.id, ()))) for band in BANDS]
