"""The page of a calibration of friction: curves, intervals, and what has changed.

Torques are those against a joint that turns alone, mean of both ways.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.series import Array
from analysis.figures.sections import ReportSection
from analysis.figures.style import Figure, new_figure, render, styled
from analysis.report.page import ReportContext, html_page
from analysis.report.page_model import PageSection, ReportFigure, ReportTable
from ft_sensor.payload import TerrainFrame
from wam.calibration.friction_file import FrictionCalibration
from wam.calibration.friction_fit import FrictionFit
from wam.calibration.friction_reach import (
    FrictionReach,
    reaches_along,
    remaining_friction,
    rendered_masses,
)
from wam.calibration.joint_friction import (
    joint_asymmetry,
    joint_breakaway,
    joint_deviation,
    speed_curve,
)
from wam.model.arm_model import ArmModel
from wam.model.constants import ArmConstants
from wam.model.friction import MotorFriction, joint_coulomb

_SIGMAS = 1.96
_SHOWN = np.geomspace(0.004, 0.5, 60)  # rad/s, of the curves
_SPEEDS = np.array([0.01, 0.05, 0.1, 0.4])  # rad/s, of the table
_SHARES = (0.0, 0.7, 0.8)  # compensated
_NOW, _BEFORE, _TRUE = "#0072B2", "#8c8c8c", "#000000"
_STYLES = (":", "--", "-.")
_MOST_DRAWN = 3  # earlier calibrations


@dataclass(frozen=True, slots=True)
class FrictionPage:
    """What stands on the page.

    Attributes:
        model: the arm with its tool.
        calibration: the new one.
        earlier: those before it, the oldest first.
        terrain: where the loads are stated.
        frame: of its ground.
        start_q: joint positions where a trial on it begins [rad], shape (7,).
        truth: friction of a simulated arm; None = it is a real one.
    """

    model: ArmModel
    calibration: FrictionCalibration
    earlier: Sequence[FrictionCalibration]
    terrain: str
    frame: TerrainFrame
    start_q: Array
    truth: MotorFriction | None = None

    def reaches(self, share: float) -> list[FrictionReach]:
        """Return what friction does along a trial with `share` compensated."""
        left = remaining_friction(self.calibration.fit, share)
        frame = self.frame
        axes, travel = frame.axes(), frame.travel
        return reaches_along(self.model, self.start_q, axes, travel, left)


def friction_rows(constants: ArmConstants, fit: FrictionFit) -> list[list[str]]:
    """Return the friction of the joints [N m], a row of eight cells for each measure.

    The first cell is the name, the others are joints 1 to 7.
    """
    friction = fit.friction
    deviation = _SIGMAS * joint_deviation(constants, fit.deviation)
    rows = [
        _row("Coulomb", joint_coulomb(constants, friction.coulomb)),
        _row("  ± (95 %)", deviation),
        _row("asymmetry", joint_asymmetry(constants, friction.asymmetry)),
        _row("break-away", joint_breakaway(constants, friction)),
    ]
    curves = [speed_curve(constants, friction, j, _SPEEDS) for j in range(7)]
    for speed, torques in zip(_SPEEDS, np.array(curves).T, strict=True):
        rows.append(_row(f"at {speed:g} rad/s", torques))
    return rows


FRICTION_HEADER = ("friction [N m]", *(f"joint {joint}" for joint in range(1, 8)))


def friction_changes(
    constants: ArmConstants, before: FrictionFit, now: FrictionFit
) -> dict[int, float]:
    """Return relative changes of Coulomb torques beyond both intervals, by joint 1-7.

    Args:
        constants: of the arm.
        before: the earlier calibration.
        now: the later one.
    """
    torques = [joint_coulomb(constants, fit.friction.coulomb) for fit in (before, now)]
    doubts = [joint_deviation(constants, fit.deviation) for fit in (before, now)]
    apart = np.abs(torques[1] - torques[0]) > _SIGMAS * np.hypot(*doubts)
    share = torques[1] / torques[0] - 1.0
    return {j + 1: float(share[j]) for j in range(7) if apart[j]}


def friction_html(page: FrictionPage) -> str:
    """Return the page as HTML."""
    calibration = page.calibration
    kind = "a simulated arm" if calibration.is_simulated else "this arm"
    context = ReportContext(
        title="Friction of the drives",
        subtitle=f"Calibration of {kind}, foot {calibration.foot}, gravity "
        f"{calibration.gravity}",
        is_simulated=calibration.is_simulated,
        is_foreign=False,
        generated_utc=calibration.measured_utc,
    )
    tables = friction_tables(page)
    parts = {
        ReportSection.FRICTION: ((), [_figure(page)]),
        ReportSection.LOADS: (_LOAD_SENTENCES, ()),
    }
    sections = [
        PageSection(
            heading,
            sentences,
            [table for table in tables if table.section is heading],
            figures,
        )
        for heading, (sentences, figures) in parts.items()
    ]
    return html_page(context, sections, change_sentences(page))


def friction_tables(page: FrictionPage) -> list[ReportTable]:
    """Return the tables of the page."""
    return [_values(page), *_comparison(page), _quality(page), _loads(page)]


_LOAD_SENTENCES = (
    "F_t and F_n are measured at the wrist, below every drive, and v_t at the "
    "joints: models of the ground are not biased by joint friction. It limits the "
    "loads and speeds that a trial reaches.",
    "F_n at rest lies anywhere within the interval, depending on how the foot was put "
    "down; a hand that puts it down from above leaves it at the lower bound.",
)


def change_sentences(page: FrictionPage) -> list[str]:
    """Return what has changed since the last calibration."""
    if not page.earlier:
        return []
    last = page.earlier[-1]
    changes = friction_changes(page.model.constants, last.fit, page.calibration.fit)
    return [
        f"Friction of joint {joint} is {abs(share):.0%} "
        f"{'higher' if share > 0.0 else 'lower'} than on {last.measured_utc}, beyond "
        "both intervals: check its cables."
        for joint, share in changes.items()
    ]


def _values(page: FrictionPage) -> ReportTable:
    rows = friction_rows(page.model.constants, page.calibration.fit)
    note = (
        "Coulomb: sliding friction at the torque that the joint bore in the "
        "calibration. Asymmetry: half of forwards less backwards. Break-away: of a "
        "joint at rest; joint 7 turns at 0.5 rad/s on every sweep, so its "
        "break-away and its slow friction are extrapolated."
    )
    return ReportTable(
        "Identified", FRICTION_HEADER, rows, note, ReportSection.FRICTION
    )


def _comparison(page: FrictionPage) -> list[ReportTable]:
    """Return Coulomb torques of every calibration, oldest first; none without one."""
    if not page.earlier:
        return []
    rows: list[list[str]] = []
    for calibration in (*page.earlier, page.calibration):
        coulomb = joint_coulomb(page.model.constants, calibration.fit.friction.coulomb)
        doubt = _SIGMAS * joint_deviation(
            page.model.constants, calibration.fit.deviation
        )
        pairs = zip(coulomb, doubt, strict=True)
        cells = [f"{value:.3f} ± {spread:.3f}" for value, spread in pairs]
        rows.append([calibration.measured_utc, *cells])
    note = "With 95 % intervals. Growing friction indicates wear."
    header = ("Coulomb [N m]", *FRICTION_HEADER[1:])
    return [
        ReportTable("Earlier calibrations", header, rows, note, ReportSection.FRICTION)
    ]


def _quality(page: FrictionPage) -> ReportTable:
    fit = page.calibration.fit
    share = fit.lower_bound / fit.friction.coulomb
    rows = [
        _row("residual, of Coulomb", fit.residual),
        _row("lower bound, of Coulomb", share),
        ["rows", *(str(count) for count in fit.rows)],
    ]
    header = ("", *(f"motor {motor}" for motor in range(1, 8)))
    note = "Residual: rms on the sweep held out from the fit."
    return ReportTable("Quality", header, rows, note, ReportSection.FRICTION)


def _loads(page: FrictionPage) -> ReportTable:
    rows: list[list[str]] = []
    for share in _SHARES:
        reaches = page.reaches(share)
        masses = rendered_masses(reaches, page.frame.incline)
        ends = [reaches[0], reaches[-1]]
        ranges = [
            " to ".join(f"{end.rest:.2f}" for end in ends),
            " to ".join(f"{end.shift:+z.2f}" for end in ends),
            " to ".join(f"{end.push:.2f}" for end in ends),
        ]
        kilograms = (masses.down, masses.half, masses.tenth)
        steps = [f"{mass:.2f}" for mass in kilograms]
        rows.append([f"{share:.0%}" if share else "none", *ranges, *steps])
    return ReportTable(
        f"Loads on {page.terrain}",
        (
            "compensated",
            "F_n at rest ± [N]",
            "F_n sliding, shifted by [N]",
            "hand's push beyond F_t [N]",
            "reliable contact from [kg]",
            "F_n within 50 % from [kg]",
            "within 10 % from [kg]",
        ),
        rows,
        "From the far to the near end; upper end (95 %) of break-away and Coulomb "
        "torques.",
        ReportSection.LOADS,
    )


def _figure(page: FrictionPage) -> ReportFigure:
    with styled():
        drawn = _draw(page)
    picture = render("friction", drawn, page.calibration.is_simulated)
    return ReportFigure(
        ReportSection.FRICTION,
        "Friction torque over joint speed",
        "Torque that resists a joint over its speed, a panel for each of the seven "
        "joints, with a 95 % band and the torque of break-away.",
        "Line: identified, mean of both ways, with its 95 % band. Triangle: "
        "break-away. Grey: earlier calibrations."
        + (" Black: true friction of the simulated arm." if page.truth else ""),
        picture,
        is_filed=False,
    )


def _draw(page: FrictionPage) -> Figure:
    figure = new_figure(4.4)
    axes = list(figure.subplots(2, 4, sharex=True).flat)
    constants, fit = page.model.constants, page.calibration.fit
    spread = _SIGMAS * joint_deviation(constants, fit.deviation)
    share = spread / joint_coulomb(constants, fit.friction.coulomb)
    broken = joint_breakaway(constants, fit.friction)
    for joint, ax in enumerate(axes[:7]):
        earlier = page.earlier[-_MOST_DRAWN:]
        for style, before in zip(_STYLES, earlier, strict=False):
            curve = speed_curve(constants, before.fit.friction, joint, _SHOWN)
            ax.plot(_SHOWN, curve, style, color=_BEFORE, lw=1.1)
        curve = speed_curve(constants, fit.friction, joint, _SHOWN)
        low, high = curve * (1.0 - share[joint]), curve * (1.0 + share[joint])
        ax.fill_between(_SHOWN, low, high, color=_NOW, alpha=0.2, lw=0)
        ax.plot(_SHOWN, curve, color=_NOW, lw=1.6)
        error = [[broken[joint] * share[joint]]] * 2
        ax.errorbar([_SHOWN[0]], [broken[joint]], error, fmt="<", color=_NOW, ms=4)
        if page.truth is not None:
            true = speed_curve(constants, page.truth, joint, _SHOWN)
            ax.plot(_SHOWN, true, color=_TRUE, lw=0.8)
        ax.set_xscale("log")
        ax.set_ylim(bottom=0.0)
        ax.set_title(f"joint {joint + 1}", loc="left")
    axes[7].set_visible(False)
    figure.supxlabel("speed of the joint [rad/s]", fontsize=8)
    figure.supylabel("torque against it [N m]", fontsize=8)
    return figure


def _row(name: str, values: Array) -> list[str]:
    return [name, *(f"{value:.3f}" for value in values)]
