"""A remote simulation has every operation of a local one."""

import numpy as np
import pytest

from acquisition.ipc.channel import Channel
from acquisition.ipc.requests import Dispatcher, ask
from acquisition.ipc.simulation import (
    AskDevices,
    RemoteSimulation,
    simulation_handlers,
)
from acquisition.schema import TRUTH
from acquisition.simulation import ServedDevices, SimulationControl

CALLS = {
    "pose": ([0.1, -0.2, 0.3, 1.8, 0.0, -0.4, 0.0], 2.0),
    "turn_to_stop": (4, "high"),
    "hang": (0.5,),
    "push_with": ([1.0, 0.0, -2.0], 0.5),
    "twist": (0.2, 1.0),
    "prepare": (3,),
    "lift": (),
    "rest": (),
    "take": (),
    "let_go": (),
    "put_down": (),
    "touch": (2,),
    "push": (),
    "pendant": ("activate",),
    "inject": ("replies-late",),
    "clear_faults": (),
}
QUESTIONS = {
    "is_hand_done": True,
    "fault_names": ("replies-late", "ft-unplugged"),
    "parameters": {"dynamics": "pinocchio"},
    "friction": {"coulomb": [0.1] * 7},
}


class Simulation:
    """Keeps every call; implements `SimulationControl`."""

    def __init__(self):
        self.done = []

    is_hand_done = QUESTIONS["is_hand_done"]
    fault_names = QUESTIONS["fault_names"]

    def parameters(self):
        return QUESTIONS["parameters"]

    def friction(self):
        return QUESTIONS["friction"]

    def __getattr__(self, name):
        return lambda *arguments: self.done.append((name, arguments))


class Loopback:
    """Answers requests at once, through a channel."""

    def __init__(self, simulation, truth):
        parts = iter([*np.array_split(truth, 3), truth[:0]])
        self.dispatcher = Dispatcher(
            simulation_handlers(simulation, lambda: next(parts)),
            {AskDevices: lambda: ServedDevices("fake", "/tmp/can", 1_000_000, "/s")},
        )
        self.near, self.far = Channel.pair()

    def send(self, value):
        self.near.send(value)
        self.dispatcher.answer(self.far)

    def receive(self):
        return self.near.receive()

    def ask(self, request):
        return ask(self, request)


@pytest.fixture
def simulation():
    return Simulation()


@pytest.fixture
def truth():
    records = np.frombuffer(bytearray(TRUTH.template * 7), TRUTH.dtype)
    records["host_ns"] = np.arange(7)
    return records


@pytest.fixture
def far(simulation, truth):
    far = Loopback(simulation, truth)
    yield far
    far.near.close()
    far.far.close()


def test_every_operation_of_a_simulation_is_exposed():
    offered = {
        name
        for owner in SimulationControl.__mro__
        for name in vars(owner)
        if not name.startswith("_")
    }
    assert offered == {*CALLS, *QUESTIONS, "take_truth"}


@pytest.mark.parametrize("name", CALLS)
def test_remote_calls_are_carried_out(far, simulation, name):
    assert getattr(RemoteSimulation(far.ask), name)(*CALLS[name]) is None
    assert simulation.done == [(name, CALLS[name])]


@pytest.mark.parametrize("name", QUESTIONS)
def test_remote_queries_are_answered(far, name):
    value = getattr(RemoteSimulation(far.ask), name)
    assert (value() if callable(value) else value) == QUESTIONS[name]


def test_arrays_of_positions_arrive_as_numbers(far, simulation):
    RemoteSimulation(far.ask).pose(np.arange(7.0), 1)
    assert simulation.done == [("pose", (list(range(7)), 1.0))]


def test_the_truth_arrives_unchanged_in_parts(far, truth):
    taken = RemoteSimulation(far.ask).take_truth()
    assert taken.dtype == TRUTH.dtype
    assert taken.tobytes() == truth.tobytes()


def test_an_empty_truth_has_no_records(simulation, truth):
    far = Loopback(simulation, truth[:0])
    assert RemoteSimulation(far.ask).take_truth().shape == (0,)
    far.near.close()
    far.far.close()


def test_the_devices_of_a_simulation_are_reported(far):
    assert far.ask(AskDevices()).port == "/s"
