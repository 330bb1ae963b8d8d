from . import (
    calibrating,
    commands,
    fault_injection,
    operator,
    preflight,
    report,
    rig,
    run,
    session,
    settings,
    tools,
    trial,
)

__all__ = [
    "calibrating",
    "commands",
    "fault_injection",
    "operator",
    "preflight",
    "report",
    "rig",
    "run",
    "session",
    "settings",
    "tools",
    "trial",
]
