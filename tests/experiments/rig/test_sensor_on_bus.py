"""The program with Barrett's wrist sensor on the arm's bus instead of a serial one."""

from importlib import resources

import numpy as np
import pytest

from acquisition.sample import Flag
from acquisition.trial_file.reader import TrialReader
from experiments.settings.load import load_settings
from tests.acquisition.ros import decode, messages_of
from tests.experiments.program import (
    only_session,
    run_short,
    sidecar,
    traction,
    write_config,
)

pytestmark = pytest.mark.slow  # whole sessions

MS = 1_000_000
LINE = ("port", "baudrate", "sinc")


@pytest.fixture(scope="module")
def on_bus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("on-bus")
    path = write_config(folder, rig=('kind = "bota"', 'kind = "barrett"'))
    path.write_text(without(path.read_text(), ["sinc"]))
    return path


@pytest.fixture(scope="module")
def session(tmp_path_factory, on_bus):
    data = tmp_path_factory.mktemp("data")
    log = data / "bus.log"
    done = run_short(on_bus, data, "TF", 1, "--can-log", log)
    assert done.code == 0, done.err
    return only_session(data), done, log


@pytest.fixture(scope="module")
def trial(session):
    return session[0] / "trials" / "T01.mcap"


def test_the_sensor_is_reported_in_the_preflight_and_its_file(session, trial):
    folder, done, _ = session
    assert "Barrett force/torque sensor, node 8, 20 of 20 questions" in done.out
    assert sidecar(trial)["status"] == "complete"
    assert "Barrett force/torque sensor" in (folder / "preflight.json").read_text()


def test_every_cycle_of_a_trial_has_its_raw_sample(trial):
    batches = [
        decode("traction_msgs/msg/WrenchBatch", payload)
        for _, payload in messages_of(trial)["/ft/raw"]
    ]
    t_ns = np.concatenate([batch.t_ns for batch in batches]).astype(np.int64)
    status = np.concatenate([batch.status for batch in batches])
    cycles = TrialReader(trial).cycles().data
    assert len(t_ns) == pytest.approx(len(cycles), abs=10)  # a batch at each end
    assert set(np.diff(t_ns)) == {2 * MS}
    assert not status.any()
    assert not (cycles["flags"] & Flag.FT_SATURATED).any()
    assert (cycles["flags"] & Flag.FT_FRESH).all()
    age = cycles["host_ns"].astype(np.int64) - cycles["ft_ns"].astype(np.int64)
    unasked = cycles["flags"] & Flag.ARM_UNASKED != 0
    assert set(age[~unasked]) == {2 * MS - 191_000}
    # Seven positions less on the bus: the reply comes within the cycle.
    assert set(age[unasked]) == {-191_000}


def test_the_force_agrees_with_that_of_a_serial_sensor(trial, first_trial):
    def median_force(path):
        traction_ = TrialReader(path).cycles().data["traction"]
        return np.median(traction_[traction_[:, 2] > 1.0], axis=0)[2]

    # The same seed and plant; biases differ by sensor and trial, 0.24 N at one sigma.
    assert median_force(trial) == pytest.approx(median_force(first_trial), abs=1.0)


def test_the_bus_log_has_a_reply_to_every_request_for_the_wrench(session):
    lines = traction("replay", "--can", session[2], "--summary").out.splitlines()
    # The absent nodes of the enumeration; of 31, nine are there.
    assert " 22 did not come; 0 came without a request" in lines[0]


def test_a_silent_sensor_is_refused_before_anything_is_created(on_bus, tmp_path):
    data = tmp_path / "data"
    done = run_short(on_bus, data, "TF", 1, "--fault", "ft-silent")
    assert done.code == 3
    assert done.err.startswith("The F/T sensor (node 8) does not answer on the arm's")
    assert not data.exists()


def without(text, keys):
    return "".join(
        line
        for line in text.splitlines(keepends=True)
        if not line.startswith(tuple(f"{key} =" for key in keys))
    )


def test_a_sensor_on_the_bus_needs_no_serial_line(tmp_path):
    text = (resources.files("experiments.data") / "rig.toml").read_text()
    path = tmp_path / "rig.toml"
    path.write_text(without(text, LINE).replace('"bota"', '"barrett"', 1))
    assert load_settings(path).rig.ft_sensor.kind == "barrett"


@pytest.mark.parametrize(
    ("kind", "option", "owners"),
    [
        ("barrett", "sinc = 64", '"bota"'),
        ("robotous", 'serial_number = "A"', '"optoforce"'),
        ("bota", "filter_hz = 150", '"robotous" and "optoforce"'),
    ],
)
def test_an_option_of_another_sensor_kind_is_refused_by_name(
    tmp_path, kind, option, owners
):
    text = (resources.files("experiments.data") / "rig.toml").read_text()
    text = without(text, ["sinc"])
    path = tmp_path / "rig.toml"
    path.write_text(text.replace('kind = "bota"', f'kind = "{kind}"\n{option}'))
    done = traction("check", "--config-only", "--config", path)
    name = option.split()[0]
    assert done.code == 2
    assert done.err.startswith(f"rig.toml: ft_sensor.{name} belongs to kind {owners},")
    assert f'"{kind}"' in done.err


def test_an_invalid_sensor_option_is_reported_without_the_kind(tmp_path):
    config = write_config(tmp_path, rig=("sinc = 64", "sinc = 13"))
    done = traction("check", "--config-only", "--config", config)
    assert done.err.startswith(
        "rig.toml: ft_sensor.sinc = 13 - expected a whole number >= 51 and <= 512"
    )


def test_a_missing_sensor_kind_is_refused_with_an_example(tmp_path):
    config = write_config(tmp_path, rig=('kind = "bota"', ""))
    done = traction("check", "--config-only", "--config", config)
    assert done.err.startswith("rig.toml: ft_sensor.kind is missing, e.g. 'bota',")


def test_a_serial_sensor_needs_its_port(tmp_path):
    text = (resources.files("experiments.data") / "rig.toml").read_text()
    path = tmp_path / "rig.toml"
    path.write_text(without(text, ["port"]))
    done = traction("check", "--config-only", "--config", path)
    assert done.code == 2
    assert done.err.startswith("rig.toml: ft_sensor.port is missing, e.g. ")


def test_an_unknown_sensor_kind_is_refused_with_the_known_kinds(tmp_path):
    config = write_config(tmp_path, rig=('kind = "bota"', 'kind = "optical"'))
    done = traction("check", "--config-only", "--config", config)
    assert done.code == 2
    assert "'bota', 'robotous', 'optoforce', 'ati' or 'barrett'" in done.err
