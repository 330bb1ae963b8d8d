from .recorder import Recorder, TrialRecording, seal
from .recorder_process import RemoteRecorder

__all__ = [
    "Recorder",
    "RemoteRecorder",
    "TrialRecording",
    "seal",
]
