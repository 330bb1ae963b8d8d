"""Options choose the arm that `traction fake` serves."""

import pytest

from experiments.calibration.kinds import CALIBRATIONS
from experiments.commands.calibrate import KINDS
from fakes.serving import home_arm
from tests.experiments.program import served_config, traction

FOOT = """\
mass = 0.3
com = [0.0, 0.01, 0.05]
inertia = [4e-4, 5e-4, 4e-4]
sole = [0.0, 0.0, 0.09]
"""


@pytest.fixture
def serve(monkeypatch, tmp_path):
    """A function that serves an arm, ends at once and returns its pose."""
    seen = []
    build = home_arm.build_home_server

    def keep(port, pose, clock):
        seen.append(pose)
        return build(port, pose, clock)

    monkeypatch.setattr(home_arm, "build_home_server", keep)
    script = tmp_path / "script"
    script.write_text("quit\n")
    where = ("--can", f"traction-fake:{tmp_path}/bus", "--script", script)

    def start(*arguments):
        done = traction("fake", *where, *arguments)
        assert done.code == 0, done.err
        return seen.pop()

    return start


def test_without_options_a_person_carries_the_arm_with_its_foot(serve):
    pose = serve()
    assert (pose.has_hand, pose.firmware) == (True, (200, 200))
    assert pose.tool.foot.mass == 0.45


def test_a_bare_arm_has_neither_hand_nor_tool(serve):
    pose = serve("--bare")
    assert (pose.has_hand, pose.tool) == (False, None)


@pytest.mark.parametrize(("hand", "has_hand"), [("carry", True), ("none", False)])
def test_the_hand_is_chosen_independently_of_the_tool(serve, hand, has_hand):
    pose = serve("--hand", hand)
    assert pose.has_hand is has_hand
    assert pose.tool is not None


def test_named_options_override_bare(serve):
    assert serve("--bare", "--tool", "tread").tool.foot.mass == 0.45
    assert serve("--bare", "--hand", "carry").has_hand


def test_a_foot_comes_from_a_file_of_its_own(serve, tmp_path):
    path = tmp_path / "foot.toml"
    path.write_text(FOOT)
    tool = serve("--tool", path).tool
    assert (tool.foot.mass, tool.sole.tolist()) == (0.3, [0.0, 0.0, 0.09])
    assert tool.sensor.mass > 0.1


@pytest.mark.parametrize(
    ("text", "firmware"), [("60", (60, 60)), ("200,40", (200, 40)), ("0", (0, 0))]
)
def test_firmware_is_set_for_pucks_and_safety_module(serve, text, firmware):
    assert serve("--firmware", text).firmware == firmware


@pytest.mark.parametrize("text", ["", "60,", "60,61,62", "-1", "6e1", "40000", "²"])
def test_an_invalid_firmware_version_is_refused(text, tmp_path):
    where = ("--can", f"traction-fake:{tmp_path}/bus")
    done = traction("fake", *where, f"--firmware={text}")
    assert done.code == 2
    assert "200 or 60,61" in done.err


@pytest.mark.parametrize(
    ("content", "word"),
    [("mass = 0.3", "missing"), ("mass = -1\n" + FOOT[11:], "mass")],
)
def test_an_invalid_foot_file_starts_nothing(tmp_path, content, word):
    path = tmp_path / "foot.toml"
    path.write_text(content)
    where = ("--can", f"traction-fake:{tmp_path}/bus", "--tool", path)
    done = traction("fake", *where)
    assert done.code == 2
    assert "foot.toml" in done.err
    assert word in done.err
    assert not (tmp_path / "bus").exists()


def test_a_missing_foot_file_is_reported(tmp_path):
    done = traction("fake", "--can", f"traction-fake:{tmp_path}/b", "--tool", "plough")
    assert done.code == 2
    assert "plough cannot be read" in done.err


@pytest.mark.parametrize("arm", [(), ("--can", "traction-fake:{}/bus")])
def test_a_serial_sensor_needs_a_tool(tmp_path, arm):
    arm = [part.format(tmp_path) for part in arm]
    done = traction("fake", *arm, "--serial", tmp_path / "s", "--tool", "none")
    assert done.code == 2
    assert "no wrist sensor" in done.err
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_sensor_is_refused_with_the_known_kinds(tmp_path):
    done = traction("fake", "--serial", tmp_path / "line", "--sensor", "bosch")
    assert done.code == 2
    assert "bota, robotous, optoforce" in done.err


def test_without_options_the_arm_is_nominal(serve):
    pose = serve()
    assert (pose.is_at_rest, pose.friction, pose.seed) == (False, None, None)
    assert pose.deviation is None


def test_pose_mount_and_friction_can_be_chosen(serve):
    pose = serve("--pose", "rest", "--mount", "90", "0", "-5", "--friction", "0.7")
    assert (pose.is_at_rest, pose.friction) == (True, 0.7)
    assert pose.deviation.mount == pytest.approx([1.5708, 0.0, -0.0873], abs=1e-4)
    assert (pose.deviation.zeros == 0.0).all()


def test_a_seed_draws_a_reproducible_arm(serve):
    one, two, again = (serve("--seed", n).deviation for n in ("1", "2", "1"))
    assert (one.zeros == again.zeros).all()
    assert (one.zeros != two.zeros).all()


def test_a_wrong_arm_is_drawn_with_its_error(serve):
    deviation = serve("--wrong", "motor-3-reversed").deviation
    assert deviation.torque[2, 2] == -1.0
    assert deviation.zeros.any()


@pytest.mark.parametrize("command", ["fake", "run", "check", "calibrate", "rehearse"])
def test_an_unknown_wrong_rig_is_refused_with_all_names(command):
    more = {"run": ["S0"], "calibrate": ["sensor"]}.get(command, [])
    done = traction(command, *more, "--wrong", "motor-9-reversed")
    assert done.code == 2
    assert "Did you mean motor-" in done.err
    assert "encoders-6-7-swapped" in done.err


def test_help_on_wrong_rigs_lists_them():
    done = traction("check", "--wrong", "help")
    assert done.code == 0
    assert "sensor-scale-95" in done.out


ARM_COMMANDS = [
    ("run", "S0"),
    ("check",),
    ("calibrate", "foot"),
    ("teach", "bay2"),
    ("commission",),
    ("bench",),
    ("zero",),
]
SIMULATED = [
    ("--fast",),
    ("--processes",),
    ("--fault", "estop"),
    ("--operator-script", "auto"),
    ("--friction", "1"),
    ("--cables", "15"),
    ("--wrong", "pidx-3-is-2"),
    ("--mount", "1", "2", "3"),
]


@pytest.mark.parametrize("option", SIMULATED, ids=lambda words: words[0])
@pytest.mark.parametrize("command", ARM_COMMANDS, ids=lambda words: words[0])
def test_an_option_of_simulations_never_reaches_a_real_rig(command, option, tmp_path):
    config = served_config(tmp_path)  # of a bus that nobody serves
    done = traction(*command, *option, "--config", config)
    assert done.code == 2
    assert "only with --fake" in done.err or "unrecognized arguments" in done.err


def test_a_mount_angle_out_of_range_is_refused():
    done = traction("check", "--fake", "--mount", "0", "400", "0")
    assert done.code == 2
    assert "degrees -180..180" in done.err


def test_an_invalid_script_line_starts_nothing(tmp_path):
    script = tmp_path / "script"
    script.write_text("idle\n2 hang much\n")
    where = ("--can", f"traction-fake:{tmp_path}/bus", "--script", script)
    done = traction("fake", *where)
    assert done.code == 2
    assert "line 2: '2 hang much' - expected hang KG" in done.err
    assert not (tmp_path / "bus").exists()


def test_every_calibration_kind_of_the_command_line_is_implemented():
    assert set(CALIBRATIONS) == set(KINDS)
