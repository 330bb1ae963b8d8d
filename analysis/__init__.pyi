from . import figures, findings, gp, report, study, terrains, tustin, validation

__all__ = [
    "figures",
    "findings",
    "gp",
    "report",
    "study",
    "terrains",
    "tustin",
    "validation",
]
