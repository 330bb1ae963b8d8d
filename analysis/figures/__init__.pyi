# pyright: reportUnknownVariableType=false
from . import (
    break_away,
    confusion,
    curves,
    errors,
    excerpts,
    foresight,
    rig,
    surfaces,
    trials,
    uncertainty,
)
from .sections import ReportSection
from .spec import PAGE_ORDER, FigureSpec
from .style import (
    MODEL_COLOURS,
    MODEL_HATCHES,
    Axes,
    Figure,
    Picture,
    name_ticks,
    new_figure,
    render,
    styled,
)

__all__ = [
    "MODEL_COLOURS",
    "MODEL_HATCHES",
    "PAGE_ORDER",
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
    "foresight",
    "name_ticks",
    "new_figure",
    "render",
    "rig",
    "styled",
    "surfaces",
    "trials",
    "uncertainty",
]
