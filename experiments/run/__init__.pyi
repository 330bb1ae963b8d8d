from .console_loop import TICK, ConsoleLoop
from .pose_walk import PoseWalk, guided
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
from .stances import LIVE_STANCE
from .stop import ArmFaultError, StopFlag, StopRequestedError, handle_signals
from .surroundings import read_poses

__all__ = [
    "LIVE_STANCE",
    "TICK",
    "ArmFaultError",
    "ConsoleLoop",
    "OpenMode",
    "PoseWalk",
    "ResumeChoice",
    "ResumeRequest",
    "SessionRequest",
    "StopFlag",
    "StopRequestedError",
    "activate",
    "choose_resume",
    "close",
    "guided",
    "handle_signals",
    "read_poses",
    "redo",
    "resume_request",
    "resume_session",
    "run_session",
]
