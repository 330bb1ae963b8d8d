# pyright: reportUnknownVariableType=false
from . import (
    break_away,
    confusion,
    curves,
    errors,
    excerpts,
    rig,
    surfaces,
    trials,
    uncertainty,
)
from .pictures import Picture
from .sections import PAGE_ORDER, ReportSection
from .spec import FigureSpec
from .style import (
    MODEL_COLOURS,
    MODEL_HATCHES,
    SPEED_LABEL,
    Axes,
    Figure,
    name_ticks,
    new_figure,
    plain,
    render,
    styled,
)

__all__ = [
    "MODEL_COLOURS",
    "MODEL_HATCHES",
    "PAGE_ORDER",
    "SPEED_LABEL",
    "Axes",
    "Figure",
    "FigureSpec",
    "Picture",
    "ReportSection",
    "break_away",
    "confusion",
    "curves",
    "errors",
    "excerpts",
    "name_ticks",
    "new_figure",
    "plain",
    "render",
    "rig",
    "styled",
    "surfaces",
    "trials",
    "uncertainty",
]
