"""Every request is carried out by a function that takes just its fields."""

import inspect
from dataclasses import fields

import pytest

from acquisition.ipc.layout import SharedLayout
from acquisition.recording.recorder import Recorder
from acquisition.recording.recorder_process import recorder_handlers
from experiments.rig import requests
from experiments.rig.arm_service import ArmAccess, ArmService
from experiments.rig.requests import AskGrants, AskStream
from fakes.clock import SteppedClock


def nothing(*_):
    raise AssertionError


@pytest.fixture
def tables():
    """Return the tables of arm and recorder; those of a simulation have their test."""
    clock, shared = SteppedClock(), SharedLayout.create()
    service = ArmService(ArmAccess(nothing, nothing, nothing, nothing), clock)
    yield service.handlers(), recorder_handlers(Recorder(shared, clock))
    shared.close()


def test_functions_take_the_fields_of_their_requests(tables):
    for table in tables:
        for request, handler in table.items():
            wanted = [field.name for field in fields(request)]
            assert list(inspect.signature(handler).parameters) == wanted, request


def test_whatever_can_be_asked_of_the_arm_is_answered(tables):
    asked = {
        kind
        for _, kind in inspect.getmembers(requests, inspect.isclass)
        if issubclass(kind, requests.Request) and kind is not requests.Request
    }
    # of a process, and of the one that reads a sensor
    assert {*tables[0], AskGrants, AskStream} == asked
