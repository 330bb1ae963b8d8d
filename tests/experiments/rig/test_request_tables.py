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
    """The tables of arm and recorder; those of a simulation have their own test."""
    clock, shared = SteppedClock(), SharedLayout.create()
    service = ArmService(ArmAccess(nothing, nothing, nothing, nothing), clock)
    yield service.handlers(), recorder_handlers(Recorder(shared, clock))
    shared.close()


def test_functions_take_the_fields_of_their_requests(tables):
    for table in tables:
        for request, handler in table.items():
            wanted = [field.name for field in fields(request)]
            assert list(inspect.signature(handler).parameters) == wanted, request


def test_every_request_to_the_arm_has_a_handler(tables):
    asked = {
        kind
        for _, kind in inspect.getmembers(requests, inspect.isclass)
        if issubclass(kind, requests.Request) and kind is not requests.Request
    }
    # the last two are answered by any process, and by that of the sensor
    assert {*tables[0], AskGrants, AskStream} == asked
