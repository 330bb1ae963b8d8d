"""Values that a listing offers are marked if an import with them is in doubt."""

import numpy as np
import pytest

from analysis.logs.suggestions import ListRequest, listing
from tests.analysis.logs.gantry import StrokeLog, write_bag2, write_urdf


@pytest.fixture
def marks(tmp_path):
    """Return a function that lists a log; it returns the marked lines."""

    def listed(stroke_log, **stated):
        log, urdf = write_bag2(tmp_path / "log", stroke_log), write_urdf(tmp_path)
        frames = {"foot": "foot", "sensor": "gauge", "acts": "ground-on-foot"}
        lines = list(listing(ListRequest(log, urdf, **(frames | stated))))
        assert lines[-1].startswith("    --"), "no command line"
        return [line for line in lines if line.startswith("▲")]

    return listed


def jumping(rows):
    """One joint state of another place."""
    joints = [row for row in rows if row[0] == "/joint_states"]
    joints[1000][2].position[0] = 1.5
    return rows


def stuck(rows):
    """The wrench of 6 s is repeated until 8 s."""
    times = [row for row in rows if row[0] == "/ft/wrench"]
    for _, _, message in times[1200:1600]:
        message.wrench.force.x = times[1200][2].wrench.force.x
        message.wrench.force.y = times[1200][2].wrench.force.y
        message.wrench.force.z = times[1200][2].wrench.force.z
        message.wrench.torque.x = times[1200][2].wrench.torque.x
        message.wrench.torque.y = times[1200][2].wrench.torque.y
        message.wrench.torque.z = times[1200][2].wrench.torque.z
    return rows


def heaving():
    """A foot that rises and falls by 20 mm on its path."""
    stroke_log = StrokeLog()
    joints = stroke_log.joints

    def heaved(t):
        q = joints(t)
        q[:, 2] += 0.01 * np.sin(9.0 * t)
        return q

    stroke_log.joints = heaved
    return stroke_log


def test_values_of_a_sound_log_are_not_marked(marks):
    assert marks(StrokeLog(turn=1.0)) == []


@pytest.mark.parametrize(
    ("stroke_log", "stated", "words"),
    [
        (StrokeLog(), {"acts": "foot-on-ground"}, "--trials: 0 of 0 pressed stretches"),
        (StrokeLog(clock_offset=0.3), {}, "over 100 ms, more than the filter of a"),
        (StrokeLog(clock_rate=1.01), {}, "is refused: "),
        (StrokeLog(changes=(jumping,)), {}, "/joint_states jumps"),
        (StrokeLog(changes=(stuck,)), {}, "unchanged reading for 2.00 s"),
        (StrokeLog(axes=(1, 0, 2)), {}, "the moments are"),
        (StrokeLog(bias_drift=0.3), {}, "halves of the window of --tare differ"),
        (heaving(), {}, "--normal: "),
    ],
    ids=lambda value: "" if isinstance(value, StrokeLog | dict) else value,
)
def test_values_of_a_bad_log_are_marked_with_the_reason(
    marks, stroke_log, stated, words
):
    marked = marks(stroke_log, **stated)
    assert any(words in line for line in marked), marked
