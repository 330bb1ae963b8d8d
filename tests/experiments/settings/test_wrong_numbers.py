"""A number that no rig has is refused, or at least gives a warning."""

import pytest
from pydantic import BaseModel

from acquisition.errors import SettingsError
from experiments.settings.load import load_settings
from experiments.settings.numbers import number_at, unusual_numbers
from tests.experiments.program import traction, write_config

SHIPPED = load_settings(None)
FACTORS = {
    "ten times": 10.0,
    "a hundred times": 100.0,
    "in degrees, and in cm nearly": 57.2957795,
    "in g, mm, us": 1000.0,
    "with the opposite sign": -1.0,
    "infinite": float("inf"),
    "not a number": float("nan"),
}
# Numbers that may have either sign.
_SIGNED = ("incline_deg", ".com[0]", ".sole[0]", "far_end", "start_q", "mech_at_home")


def numbers(section: BaseModel, place: str = ""):
    """(dotted name, value) of every number."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, dict):
            for key, entry in value.items():
                if isinstance(entry, BaseModel):
                    yield from numbers(entry, f"{place}.{name}.{key}".lstrip("."))
            continue
        for index, entry in enumerate(value if isinstance(value, tuple) else (value,)):
            item = index if isinstance(value, tuple) else None
            at = f"{place}.{name}".lstrip(".")
            at += "" if item is None else f"[{item}]"
            if isinstance(entry, BaseModel):
                yield from numbers(entry, at)
            elif number_at(field, item) is not None and entry is not None:
                yield at, entry


def with_number(section: BaseModel, name: str, value: float) -> BaseModel:
    """The section with another number, validated like a file."""
    data = section.model_dump()
    *keys, last = name.replace("[", ".").replace("]", "").split(".")
    table = data
    for part in keys:
        key = int(part) if part.isdigit() else part
        if isinstance(table[key], tuple):
            table[key] = list(table[key])
        table = table[key]
    key = int(last) if last.isdigit() else last
    is_whole = isinstance(table[key], int) and value in (value // 1, 0.0)
    table[key] = int(value) if is_whole and abs(value) < 1e15 else value
    return type(section).model_validate(_as_tuples(data))


def _as_tuples(value):
    if isinstance(value, dict):
        return {key: _as_tuples(inner) for key, inner in value.items()}
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


@pytest.mark.parametrize("kind", FACTORS)
@pytest.mark.parametrize("file", ["rig", "matrix"])
def test_every_wrong_number_is_refused_or_gives_a_warning(file, kind):
    section, silent = getattr(SHIPPED, file), []
    for name, value in numbers(section):
        is_signed = FACTORS[kind] < 0.0 and any(part in name for part in _SIGNED)
        if value == 0.0 or is_signed or name.endswith((".sign", ".seed")):
            continue
        try:
            other = with_number(section, name, FACTORS[kind] * value)
        except ValueError:
            continue
        if not list(unusual_numbers(other)):
            silent.append(name)
    assert silent == []


def test_the_shipped_numbers_are_all_usual():
    assert SHIPPED.unusual() == []


def sections(model: type[BaseModel]):
    """A section and all sections in it."""
    yield model
    for field in model.model_fields.values():
        for kind in _models(field.annotation):
            yield from sections(kind)


def _models(annotation):
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for inner in getattr(annotation, "__args__", ()) for m in _models(inner)]


def test_every_number_of_a_settings_file_has_an_upper_and_a_lower_bound():
    unbounded = []
    for root in (type(SHIPPED.rig), type(SHIPPED.matrix)):
        for section in sections(root):
            for name, field in section.model_fields.items():
                number = number_at(field, 0)
                if number is None:
                    continue
                has = {
                    k
                    for c in number.metadata
                    for k in ("gt", "ge", "lt", "le")
                    if hasattr(c, k)
                }
                if not (has & {"gt", "ge"} and has & {"lt", "le"}):
                    unbounded.append(f"{section.__name__}.{name}")
    assert unbounded == []


LIKELY = [
    ("mass = 0.45 ", "mass = 450.0", "<= 2.0 kg, e.g. 0.45 - is it in g?"),
    ("mass = 0.45 ", "mass = 4.5", "<= 2.0 kg, e.g. 0.45 - is its decimal point right"),
    ("com = [0.01, 0.0, 0.062]", "com = [0.01, 0.0, 6.2]", "0.062] - is it in cm?"),
    ("sole = [0.01, 0.0, 0.112]", "sole = [0.01, 0.0, 112.0]", "is it in mm?"),
    (
        "speed = [1.5,",
        "speed = [86.0,",
        "limits.speed[0] = 86.0 - expected a number > 0 ",
    ),
    ("speed = [1.5,", "speed = [86.0,", "<= 3.0 rad/s, e.g. [1.5, 1.5, 2.0, 2.5, 4.0"),
    ("speed = [1.5,", "speed = [86.0,", "4.0] - is it in degrees/s?"),
    ("torque = [20.0, 45.0,", "torque = [20.0, 4500.0,", "- is it in N cm?"),
    ("torque = [20.0, 45.0,", "torque = [20.0, 45.1,", "limits.torque[1] = 45.1"),
    ("foot_speed = 0.8", "foot_speed = 1.01", "<= 1.0 m/s"),
    ("joint7_mrad = 50.0", "joint7_mrad = 101.0", "<= 100 mrad"),
    ("ft_stop_ms = 20.0", "ft_stop_ms = 20000.0", "<= 50 ms, e.g. 20.0 - is it in us?"),
    ("speed_fault = 1.0", "speed_fault = 1.6", "<= 1.5 m/s"),
    ("torque_fault_units = 5204", "torque_fault_units = 8101", "<= 8100 puck units"),
    ("foot_speed = 0.8", "foot_speed = -0.8", "0.8 - is its sign right?"),
    ("lock_kp = 20.0", "lock_kp = 30.0", "<= 22 N m/rad"),
    (
        "lock_kd = 0.2 ",
        "lock_kd = 0.1 ",
        "lock of joint 7 oscillate - expected >= 0.15",
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), LIKELY)
def test_a_refusal_names_number_range_unit_and_likely_mistake(
    tmp_path, old, new, words
):
    with pytest.raises(SettingsError) as refused:
        load_settings(write_config(tmp_path, rig=(old, new)))
    assert words in refused.value.message


def test_a_number_near_its_bound_gives_a_warning_in_check(tmp_path):
    config = write_config(tmp_path, rig=("mass = 0.45 ", "mass = 1.9 "))
    words = "rig.toml: feet.tread.mass = 1.9, usual is 0.1 to 1.5 kg"
    for options in (("--config-only",), ("--fake", "--fast")):
        done = traction("check", *options, "--config", config, "--data", tmp_path)
        assert done.code == 0
        assert words in done.out


def test_a_higher_limit_of_late_cycles_is_for_a_simulated_arm_only(tmp_path):
    change = ("late_per_second = 10", "late_per_second = 21")
    config = write_config(tmp_path, rig=change)
    real = traction("check", "--config", config, "--data", tmp_path)
    assert real.code == 2
    assert "limits.late_per_second = 21 - expected <= 20 cycles/s on a real" in real.err
    fake = traction("check", "--fake", "--fast", "--config", config, "--data", tmp_path)
    assert fake.code == 0
