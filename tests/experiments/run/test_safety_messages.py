"""Messages about stops of the safety module, and the limits set in the module."""

import pytest

from acquisition.control_loop.faults import CircuitCauses, Fault, verdict_for
from acquisition.sample import Flag
from acquisition.trial_file.reader import TrialReader
from experiments.messages import FaultContext, fault_text
from experiments.operator.prompts import Prompt
from experiments.rig.build import build_safety_limits
from experiments.settings.load import load_settings
from tests.experiments.program import run_watched, traction, write_config
from wam.bus.frames import encode_set
from wam.driver.safety_module import SafetyLimits

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

CONTEXT = FaultContext("T01", 1.5)
SAFETY_TABLE = """
speed_warning = 0.5       # m/s at elbow and forearm; left out: 0.9 of the fault
speed_fault = 1.0  """
VL1 = 45


@pytest.mark.parametrize(
    ("reason", "causes", "text"),
    [
        ("pendant-idle", (), "The pendant or the safety module put the arm to idle at"),
        (
            "pendant-idle",
            ("velocity",),
            "The safety module put the arm to idle: velocity fault. "
            "ARM: idle; it sinks slowly, support it.",
        ),
        (
            "pendant-idle",
            ("torque", "heartbeat"),
            "The safety module put the arm to idle: torque fault, heartbeat fault. ARM",
        ),
        ("estop", ("other",), "Stop pressed at 1.50 s."),
        (
            "estop",
            ("voltage",),
            "The safety module stopped the arm: voltage fault. ARM",
        ),
        (
            "estop",
            ("velocity", "other"),
            "The safety module stopped the arm: velocity fault. ARM",
        ),
    ],
)
def test_a_stop_of_the_safety_circuit_is_reported_with_its_cause(reason, causes, text):
    verdict = verdict_for(Fault(reason), CircuitCauses(causes))
    assert fault_text(verdict, CONTEXT).startswith(text)


def in_recording(act):
    """A `press` that calls `act(rig)` once, in the first recording."""
    done = []

    def press(asked, rig):
        if asked.prompt is Prompt.RECORDING and asked.since > 0.3 and not done:
            done.append(act(rig))

    return press


def send_property(number, value):
    def act(rig):
        now_ns = rig.plant.t_ns
        rig.network.receive(now_ns, 0x00A, encode_set(number, value))

    return act


def test_a_velocity_warning_is_recorded_and_the_trial_is_kept(config, tmp_path):
    done = run_watched(config, tmp_path, 1, press=in_recording(send_property(VL1, 1)))
    assert done.done.code == 0
    flags = TrialReader(done.folder / "trials" / "T01.mcap").cycles().data["flags"]
    assert (flags & Flag.SAFETY_WARNING).any()
    assert not (flags & Flag.SAFETY_FAULT).any()


def test_a_trial_records_puck_temperatures_and_errors_at_its_start(first_trial):
    fields = TrialReader(first_trial).metadata["provenance"]
    assert fields["pucks:temperature_degc"] == "35 35 35 35 35 35 35"
    assert fields["pucks:error"] == "0 0 0 0 0 0 0"


def test_the_preflight_page_shows_firmware_zero_and_temperatures(tmp_path):
    done = traction("check", "--fake", "--fast", "--data", tmp_path)
    assert "firmware 200, zeroed, 33-35 °C" in done.out
    assert "idle, firmware 200" in done.out


def limits_of(folder, old="", new=""):
    path = write_config(folder, rig=(old, new) if old else None)
    return build_safety_limits(load_settings(path).rig)


def test_the_shipped_limits_are_the_power_up_values(tmp_path):
    assert limits_of(tmp_path) == SafetyLimits()


def test_a_table_without_safety_keeps_the_power_up_values(tmp_path):
    path = write_config(tmp_path)
    text = path.read_text()
    path.write_text(text[: text.index("[safety]")])
    assert build_safety_limits(load_settings(path).rig) == SafetyLimits()


def test_a_speed_warning_left_out_is_derived_from_its_fault(tmp_path):
    limits = limits_of(tmp_path, SAFETY_TABLE, "\nspeed_fault = 1.5")
    assert (limits.speed_fault, limits.speed_warning) == (1.5, pytest.approx(1.35))
    assert limits.words()["VL1"] == 0x1599


def test_a_torque_warning_left_out_is_derived_from_its_fault(tmp_path):
    line = "torque_warning_units = 4731"
    assert limits_of(tmp_path, line, "#").torque_warning_units == 4683


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            "speed_fault = 1.0",
            "speed_fault = 0",
            "rig.toml: safety.speed_fault = 0 - expected a number > 0 and <= 1.5 m/s",
        ),
        (
            "torque_fault_units = 5204",
            "torque_fault_units = 9000",
            "rig.toml: safety.torque_fault_units = 9000 - expected a whole number > 0",
        ),
        (
            "speed_warning = 0.5",
            "speed_warning = -1",
            "rig.toml: safety.speed_warning = -1 - expected a number > 0 and <= 1.5",
        ),
    ],
)
def test_safety_limits_out_of_range_are_refused(tmp_path, old, new, text):
    path = write_config(tmp_path, rig=(old, new))
    done = traction("check", "--config-only", "--config", path)
    assert done.code == 2
    assert done.err.startswith(text)
