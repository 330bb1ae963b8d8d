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
from .sections import ReportSection
from .spec import FigureSpec
from .stances import draw_stances
from .style import Figure, Picture, new_figure, render, styled

__all__ = [
    "Figure",
    "FigureSpec",
    "Picture",
    "ReportSection",
    "break_away",
    "confusion",
    "curves",
    "draw_stances",
    "errors",
    "excerpts",
    "new_figure",
    "render",
    "rig",
    "styled",
    "surfaces",
    "trials",
    "uncertainty",
]
