from . import api, figures, findings, gp, report, study, terrains, tustin, validation

__all__ = [
    "api",
    "figures",
    "findings",
    "gp",
    "report",
    "study",
    "terrains",
    "tustin",
    "validation",
]
