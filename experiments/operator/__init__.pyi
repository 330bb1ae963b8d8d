from .console import BAD, GOOD, WARNING, Console, PageRecorder, aligned
from .feedback import FeedbackSignal, OperatorFeedback, build_feedback
from .graphs import KeptRow, LiveScales, WayTrace, packed, trace_lines
from .keys import (
    AFTER_FAULT,
    NOTE_KEYS,
    REJECT_REASONS,
    FootKeys,
    KeyAction,
    key_action,
    screen_keys,
)
from .prompts import OperatorInput, Prompt, PromptState
from .screens import (
    OTHER_RIG_TEXT,
    EndView,
    ForesightView,
    ReadyView,
    RecordingView,
    end_lines,
    live_line,
    ready_lines,
    recording_lines,
)
from .scripted import NO_PERSONS, choose_operator
from .terminal import TerminalInput, keyboard, login_name, wait_for_key

__all__ = [
    "AFTER_FAULT",
    "BAD",
    "GOOD",
    "NOTE_KEYS",
    "NO_PERSONS",
    "OTHER_RIG_TEXT",
    "REJECT_REASONS",
    "WARNING",
    "Console",
    "EndView",
    "FeedbackSignal",
    "FootKeys",
    "ForesightView",
    "KeptRow",
    "KeyAction",
    "LiveScales",
    "OperatorFeedback",
    "OperatorInput",
    "PageRecorder",
    "Prompt",
    "PromptState",
    "ReadyView",
    "RecordingView",
    "TerminalInput",
    "WayTrace",
    "aligned",
    "build_feedback",
    "choose_operator",
    "end_lines",
    "key_action",
    "keyboard",
    "live_line",
    "login_name",
    "packed",
    "ready_lines",
    "recording_lines",
    "screen_keys",
    "trace_lines",
    "wait_for_key",
]
