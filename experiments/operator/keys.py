"""The table of the operator's keys: action, text on the screen, word in a script."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

from experiments.operator.prompts import Prompt

REJECT_REASONS = {
    "1": "foot left the bed",
    "2": "too fast",
    "3": "touched the frame",
    "4": "sensor",
    "5": "other",
}


class KeyAction(Enum):
    """Action of a key."""

    CONFIRM = "confirm"
    RECORD = "record"
    STOP = "stop"
    NOTE = "note"
    VIEW = "view"
    PAUSE = "pause"
    KEEP = "keep"
    REDO = "redo"
    UNDO = "undo"
    TICK = "tick"
    RESUME = "resume"
    CLOSE = "close"
    FINISH = "finish"
    QUIT = "quit"


class Operand(Enum):
    """Argument after the word of a key in a script."""

    NOTHING = ""
    TEXT = " TEXT"
    REASON = " 1..5"


@dataclass(frozen=True, slots=True)
class OperatorKey:
    """A key at one prompt.

    Attributes:
        key: character from the keyboard.
        action: its action.
        help: description in docs/sessions.md.
        screen: text on the screen; empty = not shown.
        word: word in an operator script; empty = none.
        operand: argument after the word.
    """

    key: str
    action: KeyAction
    help: str = ""
    screen: str = ""
    word: str = ""
    operand: Operand = Operand.NOTHING

    @property
    def label(self) -> str:
        """The key as docs/sessions.md shows it."""
        label = f"`{'space' if self.key == ' ' else self.key}`"
        if self.action is KeyAction.TICK:
            return f"{label} to `{MAX_STEPS}`"
        reasons = f" and `{min(REJECT_REASONS)}` to `{max(REJECT_REASONS)}`"
        return label + reasons if self.operand is Operand.REASON else label


MAX_STEPS = 9  # steps of a reset, each ticked by its digit
_CONFIRM = OperatorKey(" ", KeyAction.CONFIRM)
_QUIT = OperatorKey("q", KeyAction.QUIT, "end the session")
_UNDO = OperatorKey(
    "u", KeyAction.UNDO, "take back the last verdict, within 10 s of it"
)
_SHORT = {"1": "off the bed", "3": "frame", "4": "sensor"}  # a line has 80 columns
_REASONS = "  ".join(
    f"{key} {_SHORT.get(key, reason)}" for key, reason in REJECT_REASONS.items()
)
_REASON_LIST = ", ".join(f"{key} {why}" for key, why in REJECT_REASONS.items())

KEYS: Mapping[Prompt, tuple[OperatorKey, ...]] = {
    Prompt.CHOICE: (
        OperatorKey("1", KeyAction.RESUME),
        OperatorKey("r", KeyAction.RESUME),
        OperatorKey("2", KeyAction.CLOSE),
        OperatorKey("n", KeyAction.CLOSE),
        _QUIT,
    ),
    Prompt.FOOT: (_CONFIRM, _QUIT),
    Prompt.SUPPORT: (
        OperatorKey(
            " ",
            KeyAction.CONFIRM,
            "confirm that you support the arm, and press Shift-activate on the pendant",
        ),
        _QUIT,
    ),
    Prompt.CONFIRM: (_CONFIRM, _QUIT),
    # Another key than at the other prompts: a stuck pedal or a held key must not
    # confirm a motion of the arm or let it sink.
    Prompt.MOVE: (
        OperatorKey("g", KeyAction.CONFIRM, "let it move, once the space is clear"),
        replace(_QUIT, help="end without moving"),
    ),
    Prompt.MOVING: (_QUIT,),
    Prompt.TOUCH: (_CONFIRM, OperatorKey("d", KeyAction.FINISH), _QUIT),
    Prompt.LIFT: (replace(_UNDO, word="undo"), _QUIT),
    Prompt.UNDO: (_CONFIRM, _UNDO, _QUIT),
    Prompt.LAY_DOWN: (
        OperatorKey("i", KeyAction.CONFIRM, "let it go idle, once you support it"),
    ),
    Prompt.READY: (
        OperatorKey(" ", KeyAction.RECORD, "start recording", "[space] record"),
        OperatorKey(
            "n",
            KeyAction.NOTE,
            "write a note on the session",
            "[n]ote",
            "note",
            Operand.TEXT,
        ),
        OperatorKey(
            "v", KeyAction.VIEW, "show the last review again", "[v]iew last", "view"
        ),
        OperatorKey(
            "p",
            KeyAction.PAUSE,
            "pause: the arm holds until you press `space`",
            "[p]ause",
            word="pause",
        ),
        OperatorKey(
            "q",
            KeyAction.QUIT,
            "end the session after the next trial; pressed twice, end it now",
            "[q]uit after this",
            "last",
        ),
        _UNDO,
        OperatorKey("1", KeyAction.TICK, "tick off a reset step"),
        *(OperatorKey(str(n), KeyAction.TICK) for n in range(2, MAX_STEPS + 1)),
    ),
    Prompt.PAUSED: (_CONFIRM, _QUIT),
    Prompt.DAMPED: (
        OperatorKey(" ", KeyAction.CONFIRM, "make it hold again, once you support it"),
        _QUIT,
    ),
    Prompt.RECORDING: (
        OperatorKey(" ", KeyAction.STOP, "end the trial early", "[space] stop early"),
        _QUIT,
    ),
    Prompt.REVIEW: (
        OperatorKey("k", KeyAction.KEEP, "keep the trial", "[k]eep", "keep"),
        OperatorKey(
            "r",
            KeyAction.REDO,
            f"reject and repeat the trial; the digit is the reason: {_REASON_LIST}",
            f"[r]edo: {_REASONS}",
            "redo",
            Operand.REASON,
        ),
        OperatorKey(
            "n",
            KeyAction.NOTE,
            "write a note on the trial",
            "[n]ote",
            "remark",
            Operand.TEXT,
        ),
        OperatorKey(
            "q",
            KeyAction.QUIT,
            "end the session after this verdict; pressed twice, or after an incomplete "
            "trial, reject the trial and end now",
            word="quit",
        ),
    ),
}
# How to go on after a fault, by prompt; None: the session has ended.
AFTER_FAULT: Mapping[Prompt | None, str] = {
    None: "run: {command}",
    Prompt.READY: "lift the foot for the tare; [space] records again",
    Prompt.PAUSED: "[space] goes on",
    Prompt.REVIEW: "give the verdict: [k]eep, or [r]edo and the digit of a reason",
}
NOTE_KEYS = "Type the note: Enter ends it, Esc cancels it."
STOP_KEYS = "Ctrl-C finish safely, twice = stop now"

# Prompts whose keys docs/sessions.md explains, with their descriptions there.
_EXPLAINED = {
    Prompt.SUPPORT: "before the arm is activated",
    Prompt.DAMPED: "the arm is damped after it moved too fast",
    Prompt.MOVE: "before the arm moves by itself",
    Prompt.LAY_DOWN: "before the arm goes idle",
    Prompt.READY: "between two trials",
    Prompt.RECORDING: "while recording",
    Prompt.REVIEW: "at the review",
}


def key_action(prompt: Prompt, key: str) -> KeyAction | None:
    """Return the action of `key` at `prompt`, or None.

    Args:
        prompt: the prompt.
        key: key from an `OperatorInput`; for REDO with the digit of its reason.
    """
    for entry in KEYS.get(prompt, ()):
        if entry.operand is Operand.REASON:
            if key[:1] == entry.key and key[1:] in REJECT_REASONS:
                return entry.action
        elif key == entry.key:
            return entry.action
    return None


def awaits_reason(prompt: Prompt, key: str) -> bool:
    """Return whether `key` waits for the digit of a reason at `prompt`."""
    entries = KEYS.get(prompt, ())
    return any(e.key == key and e.operand is Operand.REASON for e in entries)


def screen_keys(prompt: Prompt) -> str:
    """Return the keys of `prompt` as the screen shows them."""
    return "  ".join(entry.screen for entry in KEYS[prompt] if entry.screen)


def script_keys(prompt: Prompt) -> dict[str, OperatorKey]:
    """Return the keys that a script can press at `prompt`, by word."""
    return {entry.word: entry for entry in KEYS.get(prompt, ()) if entry.word}


def key_rows() -> list[str]:
    """Return the rows of the table of keys in docs/sessions.md."""
    rows: list[str] = []
    for prompt, when in _EXPLAINED.items():
        shown = [entry for entry in KEYS[prompt] if entry.help]
        if prompt is Prompt.RECORDING:
            shown = [entry for entry in shown if entry.screen]
        cells = [f"{entry.label} | {entry.help} |" for entry in shown]
        rows += [f"| {when} | {cells[0]}", *(f"| | {cell}" for cell in cells[1:])]
    return rows
