"""Screens, scripts, help and docs agree with the table of keys."""

import argparse
import re
from pathlib import Path

import pytest

from acquisition.errors import SettingsError
from experiments.commands.run import add_arguments
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.keys import (
    KEYS,
    REJECT_REASONS,
    KeyAction,
    Operand,
    awaits_reason,
    key_action,
    key_rows,
    screen_keys,
    script_keys,
)
from experiments.operator.prompts import Prompt, PromptState
from experiments.operator.scripted import ScriptedOperator

PAGE = Path(__file__).parents[3] / "docs" / "sessions.md"
SCRIPTED = [
    (prompt, word)
    for prompt in (Prompt.READY, Prompt.REVIEW)
    for word in script_keys(prompt)
]


def state(prompt, since=100.0):
    return PromptState(prompt, 1, 1, is_complete=True, since=since)


def script_line(prompt, word):
    operand = script_keys(prompt)[word].operand
    return word + {Operand.TEXT: " a b", Operand.REASON: " 3"}.get(operand, "")


def test_the_table_of_keys_is_on_the_page():
    assert "\n".join(key_rows()) in PAGE.read_text()


@pytest.mark.parametrize(("prompt", "word"), SCRIPTED)
def test_a_word_of_a_script_presses_its_key_at_its_prompt(tmp_path, prompt, word):
    script = tmp_path / "script.txt"
    script.write_text(script_line(prompt, word))
    entry = script_keys(prompt)[word]
    key = ScriptedOperator(script).answer(state(prompt))
    assert key_action(prompt, key) is entry.action


@pytest.mark.parametrize(("prompt", "word"), SCRIPTED)
def test_every_word_of_a_script_is_in_help_page_and_refusal(tmp_path, prompt, word):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    bad = tmp_path / "bad.txt"
    bad.write_text("fly")
    with pytest.raises(SettingsError) as refusal:
        ScriptedOperator(bad)
    operand = script_keys(prompt)[word].operand
    assert f"{word}{operand.value}" in " ".join(parser.format_help().split())
    assert f"{word}{operand.value}" in str(refusal.value)
    shown = f"`{word} 1`" if operand is Operand.REASON else f"`{word}{operand.value}`"
    assert shown in PAGE.read_text()


@pytest.mark.parametrize("prompt", KEYS)
def test_every_key_of_a_prompt_has_one_action(prompt):
    keys = [entry.key for entry in KEYS[prompt]]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("prompt", KEYS)
def test_the_automatic_operator_presses_only_keys_of_the_prompt(prompt):
    key = AutoOperator().answer(state(prompt))
    assert not key or key_action(prompt, key) is not None


@pytest.mark.parametrize("digit", REJECT_REASONS)
def test_a_redo_needs_its_reason(digit):
    assert key_action(Prompt.REVIEW, f"r{digit}") is KeyAction.REDO
    assert key_action(Prompt.REVIEW, "r") is None
    assert key_action(Prompt.REVIEW, "r9") is None


def test_only_the_key_of_a_redo_waits_for_a_digit():
    waiting = {
        (prompt, entry.key)
        for prompt, entries in KEYS.items()
        for entry in entries
        if awaits_reason(prompt, entry.key)
    }
    assert waiting == {(Prompt.REVIEW, "r")}


def test_a_key_of_another_prompt_has_no_action():
    assert key_action(Prompt.READY, "k") is None
    assert key_action(Prompt.NOTE, "n") is None


def test_the_screen_shows_every_reason_of_a_redo():
    shown = screen_keys(Prompt.REVIEW)
    for key, why in REJECT_REASONS.items():
        (label,) = re.findall(rf"(?:: |  ){key} ([a-z ]+?)(?=  |$)", shown)
        assert set(label.split()) <= {*why.split(), "off"}


@pytest.mark.parametrize("prompt", KEYS)
def test_the_keys_of_a_prompt_fit_a_line_of_eighty_columns(prompt):
    assert len(screen_keys(prompt)) <= 80
