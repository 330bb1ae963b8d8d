from .console_loop import TICK, ConsoleLoop
from .ready import activate
from .resume import (
    ResumeChoice,
    ResumeRequest,
    choose_resume,
    close,
    redo,
    resume_request,
    resume_session,
)
from .session import OpenMode, SessionRequest, run_session
from .stop import ArmFaultError, StopFlag, StopRequestedError, handle_signals

__all__ = [
    "TICK",
    "ArmFaultError",
    "ConsoleLoop",
    "OpenMode",
    "ResumeChoice",
    "ResumeRequest",
    "SessionRequest",
    "StopFlag",
    "StopRequestedError",
    "activate",
    "choose_resume",
    "close",
    "handle_signals",
    "redo",
    "resume_request",
    "resume_session",
    "run_session",
]
