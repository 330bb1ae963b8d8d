from .drawing import DRAWN_TYPES
from .foresight_page import foresight_figure
from .friction_page import (
    FRICTION_HEADER,
    FrictionPage,
    friction_html,
    friction_rows,
)
from .page import ReportContext, write_report
from .page_model import BedPhoto, ReportFigure, ReportTable
from .stance_page import StanceGroup, draw_stances, stance_html
from .what_if import StudyVariant, parse_choice, parse_window
from .what_if_tables import plain_choice, side_by_side

__all__ = [
    "DRAWN_TYPES",
    "FRICTION_HEADER",
    "BedPhoto",
    "FrictionPage",
    "ReportContext",
    "ReportFigure",
    "ReportTable",
    "StanceGroup",
    "StudyVariant",
    "draw_stances",
    "foresight_figure",
    "friction_html",
    "friction_rows",
    "parse_choice",
    "parse_window",
    "plain_choice",
    "side_by_side",
    "stance_html",
    "write_report",
]
