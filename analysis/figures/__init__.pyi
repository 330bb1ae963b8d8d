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
from .style import Picture, render, styled

__all__ = [
    "FigureSpec",
    "Picture",
    "ReportSection",
    "break_away",
    "confusion",
    "curves",
    "errors",
    "excerpts",
    "render",
    "rig",
    "styled",
    "surfaces",
    "trials",
    "uncertainty",
]
