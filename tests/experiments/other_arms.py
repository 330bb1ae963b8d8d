"""Simulated arms that differ from the usual one, under the whole program."""

from fakes.pucks.options import NetworkOptions
from fakes.world import plain_world


def serve(monkeypatch, options=None, prepare=None):
    """Give every simulated rig the network `options`, changed by `prepare`."""

    class OtherRig(plain_world.FakeRig):
        def __init__(self, *arguments, **named):
            super().__init__(*arguments, **{"network": options, **named})
            if prepare is not None:
                prepare(self.network)

    monkeypatch.setattr(plain_world, "FakeRig", OtherRig)


def firmware(motor, safety=None):
    """Network options of an arm of one firmware generation."""
    safety = motor if safety is None else safety
    return NetworkOptions(vers=(motor,) * 7, safety_vers=safety, monitor_vers=3)


def deaf_to(*requests):
    """A `prepare` that makes a network lose requests of (identifier, first byte)."""

    def prepare(network):
        receive = network.receive
        network.receive = lambda t, i, d: (
            None if (i, d[0]) in requests else receive(t, i, d)
        )

    return prepare
