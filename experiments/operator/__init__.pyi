from .console import BAD, GOOD, WARNING, Console, PageRecorder
from .feedback import FeedbackSignal, OperatorFeedback, build_feedback
from .keys import (
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
from .scripted import choose_operator
from .terminal import TerminalInput, keyboard, wait_for_key

__all__ = [
    "BAD",
    "GOOD",
    "NOTE_KEYS",
    "OTHER_RIG_TEXT",
    "REJECT_REASONS",
    "WARNING",
    "Console",
    "EndView",
    "FeedbackSignal",
    "FootKeys",
    "ForesightView",
    "KeyAction",
    "OperatorFeedback",
    "OperatorInput",
    "PageRecorder",
    "Prompt",
    "PromptState",
    "ReadyView",
    "RecordingView",
    "TerminalInput",
    "build_feedback",
    "choose_operator",
    "end_lines",
    "key_action",
    "keyboard",
    "live_line",
    "ready_lines",
    "recording_lines",
    "screen_keys",
    "wait_for_key",
]
