"""Every change of an input makes exactly the steps of its row stale.

Settings are changed in rig.toml and matrix.toml, properties in the replies of the
pucks; the digests of both are those that commands make.
"""

from dataclasses import replace

import pytest

from experiments.commissioning.evidence.gate import lacks
from experiments.commissioning.evidence.inputs import current_inputs
from experiments.commissioning.evidence.order import ORDER, REPORTED_INPUTS, STEP_INPUTS
from experiments.preflight.connecting import connect_rig
from experiments.rig.requests import LastAnswers, OpenSensor, StartArm
from experiments.rig.rig import FakeOptions
from experiments.settings.calibrations import PREFIX
from experiments.settings.load import load_settings
from lab.guest.commissioned import record_of
from tests.experiments.commissioning.test_record import NOON
from tests.experiments.program import changed, write_config

SETTINGS = {  # name of the input: file, old text, new text
    "[safety]": ("rig.toml", "speed_fault = 1.0", "speed_fault = 0.9"),
    "[limits]": ("rig.toml", "foot_speed = 0.8 ", "foot_speed = 0.7 "),
    "[arm]": ("rig.toml", "[arm]\n", "[arm]\nrest = [0, -2, 0, 3, 0, 0, 0]\n"),
    "zero": ("rig.toml", "[arm]\n", "[arm]\nmech_at_home = [1, 2, 3, 4, 5, 6, 7]\n"),
    "[feet]": ("rig.toml", "mass = 0.45  ", "mass = 0.46  "),
    "[ft_sensor]": ("rig.toml", "angle_deg = 0.0", "angle_deg = 1.0"),
    "[gravity]": ("rig.toml", 'model = "cad"', 'model = "shipped"'),
    "[friction]": ("rig.toml", "compensation = 0.7", "compensation = 0.6"),
    "[control]": ("rig.toml", "lock_kp = 20.0", "lock_kp = 21.0"),
    "[can]": ("rig.toml", 'channel = "can0"', 'channel = "can1"'),
    "terrain": ("matrix.toml", "heading_deg = 0.0", "heading_deg = 1.0"),
}
PUCK = ("SN", "VERS", "ROLE", "CTS", "PIDX", "GRPA", "GRPB", "GRPC")
MOTOR = ("IPNM", "POLES", "MT")


def connected(folder):
    """The rig of rig.toml, its replies, its start and the metadata of its sensor."""
    settings = load_settings(folder / "rig.toml")
    rig = connect_rig(
        settings, settings.matrix.terrains[0], FakeOptions("fast", 1, 0.7)
    )
    try:
        info = rig.backend.ask(StartArm())
        answers = rig.backend.ask(LastAnswers())
        return rig, answers, info, rig.backend.ask(OpenSensor())
    finally:
        rig.backend.close()


def commissioned(present):
    """Record of all steps with the inputs `present`."""
    return record_of(ORDER, present, NOON)


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A rig that has not changed since its commissioning."""
    folder = tmp_path_factory.mktemp("sound")
    write_config(folder)
    return connected(folder)


def stale(sound, present):
    """The steps that are stale with the inputs `present`."""
    lacking = lacks(commissioned(current_inputs(*sound)), present, NOON)
    assert all(": stale: " in lack.text for lack in lacking)
    return tuple(lack.step for lack in lacking)


def test_nothing_is_stale_where_nothing_changed(sound, tmp_path):
    write_config(tmp_path)
    assert stale(sound, current_inputs(*connected(tmp_path))) == ()


@pytest.mark.parametrize("name", SETTINGS)
def test_a_changed_section_makes_its_steps_stale(sound, tmp_path, name):
    write_config(tmp_path)
    file, old, new = SETTINGS[name]
    path = tmp_path / file
    path.write_text(changed(path.read_text(), old, new))
    present = current_inputs(*connected(tmp_path))
    assert stale(sound, present) == STEP_INPUTS[name].steps


@pytest.mark.parametrize("joint", [1, 7])
@pytest.mark.parametrize("name", [*PUCK, *MOTOR])
def test_a_changed_puck_property_makes_its_steps_stale(sound, joint, name):
    rig, answers, info, sensor = sound
    other = [dict(answer) for answer in answers]
    assert other[joint - 1][name] is not None
    other[joint - 1][name] += 1
    changed = "pucks" if name in PUCK else "motors"
    assert (
        stale(sound, current_inputs(rig, other, info, sensor))
        == STEP_INPUTS[changed].steps
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda info: {"safety_vers": info.safety_vers + 1},
        lambda info: {"safety_serial": info.safety_serial + 1},
        *(
            lambda info, i=i: {
                "safety_defaults": tuple(
                    value + (k == i) for k, value in enumerate(info.safety_defaults)
                )
            }
            for i in range(4)
        ),
    ],
    ids=["firmware", "serial", "VL1", "VL2", "TL1", "TL2"],
)
def test_another_safety_module_or_other_limits_make_its_steps_stale(sound, change):
    rig, answers, info, sensor = sound
    assert info.safety_defaults == (2048, 4096, 4731, 5204)
    other = replace(info, **change(info))
    present = current_inputs(rig, answers, other, sensor)
    assert stale(sound, present) == STEP_INPUTS["module"].steps


def test_a_module_without_a_serial_number_makes_no_step_stale(sound):
    rig, answers, info, sensor = sound
    silent = replace(info, safety_serial=None)
    assert stale(sound, current_inputs(rig, answers, silent, sensor)) == ()


SENSOR_IDENTITY = {"serial_number": "BFT-1", "firmware": "3.2"}  # once it has booted


@pytest.mark.parametrize("name", ["model", *SENSOR_IDENTITY])
def test_another_wrist_sensor_makes_its_steps_stale(sound, name):
    rig, answers, info, sensor = sound
    full = {**sensor, **SENSOR_IDENTITY}
    before = commissioned(current_inputs(rig, answers, info, full))
    other = current_inputs(rig, answers, info, {**full, name: f"{full[name]}1"})
    lacking = [lack.step for lack in lacks(before, other, NOON)]
    assert tuple(lacking) == STEP_INPUTS["sensor"].steps


def test_a_sensor_of_unknown_identity_makes_no_step_stale(sound):
    rig, answers, info, sensor = sound
    assert sensor["serial_number"].startswith("unknown")
    silent = current_inputs(rig, answers, info, sensor)
    full = current_inputs(rig, answers, info, {**sensor, **SENSOR_IDENTITY})
    assert lacks(commissioned(full), silent, NOON) == []
    assert lacks(commissioned(silent), full, NOON) == []


def test_every_basis_is_changed_by_a_test():
    # Changes reported by persons: tests/experiments/commissioning/test_record.py.
    assert {*SETTINGS, *REPORTED_INPUTS, "pucks", "motors", "module", "sensor"} == set(
        STEP_INPUTS
    )


def test_a_container_measured_again_makes_its_steps_stale(sound):
    rig, answers, info, _ = sound
    row = rig.row.model_copy(update={"calibration": "terrain_S0.toml"})

    def measured(text):
        texts = {**rig.settings.calibrations, f"{PREFIX}terrain_S0.toml": text}
        settings = replace(rig.settings, calibrations=texts)
        return replace(rig, row=row, settings=settings)

    before = commissioned(current_inputs(measured("incline = 0.1"), answers, info))
    again = current_inputs(measured("incline = 0.2"), answers, info)
    lacking = [lack.step for lack in lacks(before, again, NOON)]
    assert tuple(lacking) == STEP_INPUTS["terrain"].steps
