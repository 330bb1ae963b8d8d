"""Every key that a text names exists on the screen that follows."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import experiments
from acquisition.control_loop.faults import FAULTS, Action
from experiments.messages import CATALOGUE
from experiments.operator.keys import AFTER_FAULT, KEYS, REJECT_REASONS, key_action
from experiments.operator.prompts import Prompt

NAMED = re.compile(r"\[(space|[a-z]|r?[1-9])\](?![\w.]*\()")
CODE = Path(experiments.__file__).parent
# Where texts of a module appear; several for a screen with a key for each.
SHOWN_AT = {
    "calibration/taught_place.py": {Prompt.TOUCH},
    "calibration/terrain.py": {Prompt.TOUCH},
    "calibration/touching.py": {Prompt.TOUCH},
    "commands/commission.py": {Prompt.CONFIRM},
    "operator/keys.py": set(KEYS),
    "operator/screens.py": {Prompt.READY},
    "commissioning/manual_joints.py": {Prompt.CONFIRM},
    "commissioning/daily.py": {Prompt.CONFIRM},
    "commissioning/guide.py": {Prompt.CONFIRM},
    "commissioning/lock_clock.py": {Prompt.CONFIRM, Prompt.PAUSED},
    "commissioning/rest_pose.py": {Prompt.CONFIRM},
    "commissioning/scales.py": {Prompt.CONFIRM},
    "commissioning/stop_circuit.py": {Prompt.PAUSED},
    "commissioning/weights.py": {Prompt.CONFIRM},
    "run/context.py": {Prompt.LIFT, Prompt.READY, Prompt.UNDO},
    "run/console_loop.py": {Prompt.DAMPED, Prompt.LAY_DOWN},
    "run/pose_walk.py": {Prompt.MOVE, Prompt.MOVING},
    "run/ready.py": {Prompt.READY, Prompt.PAUSED, Prompt.SUPPORT},
    "run/resume.py": {Prompt.CHOICE},
    "run/verdicts.py": {Prompt.REVIEW, Prompt.UNDO},
    "run/tare.py": {Prompt.SUPPORT},
}
UNITS = ("report/", "export/", "commands/fake.py")  # [m] and [s] are units there


def keys_named(text):
    return [" " if key == "space" else key for key in NAMED.findall(text)]


def exists(prompt, key):
    """Whether a key, as a text names it, has an action at a prompt."""
    return any(
        key_action(prompt, key + digit) is not None for digit in ("", *REJECT_REASONS)
    )


@cache
def texts():
    """(module, text) of every text in the code that names a key."""
    pairs = []
    for path in sorted(CODE.rglob("*.py")):
        if str(path.relative_to(CODE)).startswith(UNITS):
            continue
        docs = set()
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                docs.add(id(node.value))
        for node in ast.walk(tree):
            is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
            if is_text and id(node) not in docs and keys_named(node.value):
                pairs.append((str(path.relative_to(CODE)), node.value))
    return pairs


def test_a_text_of_the_program_names_keys_of_its_screen():
    for module, text in texts():
        assert module in SHOWN_AT, f"{module} names a key: at which prompt?"
        for key in keys_named(text):
            assert any(exists(prompt, key) for prompt in SHOWN_AT[module]), (key, text)


def test_every_module_of_the_table_names_keys():
    assert {module for module, _ in texts()} == set(SHOWN_AT)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_message_names_keys_of_the_prompt_that_follows(name):
    message = CATALOGUE[name]
    assert not keys_named(message.what + message.more + message.arm)
    named = keys_named(message.do)
    assert bool(named) is bool(message.prompt)
    for key in named:
        assert exists(Prompt(message.prompt), key)


@pytest.mark.parametrize("prompt", AFTER_FAULT)
def test_the_continuation_after_a_fault_names_existing_keys(prompt):
    named = keys_named(AFTER_FAULT[prompt])
    assert bool(named) is (prompt is not None)
    assert all(exists(prompt, key) for key in named)


@pytest.mark.parametrize("fault", FAULTS)
def test_only_a_fault_that_leaves_the_session_open_states_how_to_continue(fault):
    leaves_open = FAULTS[fault].actions[-1] in {
        Action.END_TRIAL,
        Action.HOLD,
        Action.DAMP,
    }
    if "{then}" in CATALOGUE[fault.value].do:
        assert leaves_open


def test_a_key_that_does_not_exist_is_detected():
    assert keys_named("then [r]edo, [space] or [2]") == ["r", " ", "2"]
    assert exists(Prompt.REVIEW, "r")
    assert not exists(Prompt.READY, "r")
    assert not exists(Prompt.LIFT, " ")
