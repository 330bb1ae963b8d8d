"""Faults of the simulated wrist sensor by name, and their end."""

from collections.abc import Callable

from fakes.pucks.network import PuckNetwork
from fakes.sensor.stream import SensorStream
from wam.bus.frames import SENSOR_NODE

CLOCK_JUMP_US = 10_000_000


def stream_faults(
    stream: SensorStream, unplug: Callable[[], None], now_ns: Callable[[], int]
) -> dict[str, Callable[[], None]]:
    """Return what each name does to a sensor on a serial port.

    Args:
        stream: the sensor.
        unplug: pulls the cable.
        now_ns: tells the time of the simulation [ns].
    """
    faults = stream.faults
    return {
        "ft-silent": stream.go_silent,
        "ft-stale": stream.go_silent,
        "ft-frozen": faults.freeze,
        "ft-garbled": lambda: setattr(faults, "is_garbled", True),
        "ft-saturated": stream.saturate,
        "ft-not-a-number": lambda: setattr(faults, "is_nonsense", True),
        "ft-unplugged": unplug,
        "ft-reboot": lambda: stream.reset(now_ns()),
        "ft-clock-jump": lambda: stream.jump_clock(CLOCK_JUMP_US),
    }


def bus_sensor_faults(network: PuckNetwork) -> dict[str, Callable[[], None]]:
    """Return what each name does to a sensor on the arm's bus."""
    return {
        "ft-silent": lambda: network.silence(SENSOR_NODE),
        "ft-stale": lambda: network.silence(SENSOR_NODE),
        "ft-reboot": lambda: network.reboot(SENSOR_NODE),
    }
