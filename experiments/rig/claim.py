"""Before the first frame: is the bus free of other masters, is the arm at rest?

And at the end: an arm that never got a torque is left as it is.
"""

from acquisition.clock import Clock
from acquisition.devices import SafetyMode
from acquisition.errors import LinkTimeoutError
from experiments.messages import preflight_error
from wam.bus.link import CanLink
from wam.driver.arm import WamArm

LISTEN_NS = 50_000_000  # 25 cycles of another master at 500 Hz
_QUESTIONS = 3  # a lost answer must not let the start-up write to an active arm
_LOOK_NS = 5_000_000  # between two looks, so that no buffer of a socket overflows


def check_alone(link: CanLink, clock: Clock, bus: str) -> None:
    """Listen for 50 ms without sending anything.

    Args:
        link: to the bus.
        clock: the time to listen by.
        bus: what it is called in the message.

    Raises:
        PreflightError: another master talks.
        LinkError: the bus is down.
    """
    end_ns = clock.now_ns() + LISTEN_NS
    while clock.now_ns() < end_ns:
        clock.sleep_until(min(end_ns, clock.now_ns() + _LOOK_NS))
        link.receive()
    if link.foreign_ids:
        identifiers = " ".join(f"{can_id:03X}" for can_id in sorted(link.foreign_ids))
        raise preflight_error("other-master", bus=bus, identifiers=identifiers)


def check_inactive(arm: WamArm) -> None:
    """Ask the safety module for its mode, three times at most, and nothing else.

    Silence is left to the start-up, which says more about it.

    Raises:
        PreflightError: the arm is active.
        LinkError: the bus is down.
    """
    for _ in range(_QUESTIONS):
        try:
            mode = arm.safety.mode()
        except LinkTimeoutError:
            continue
        if mode is SafetyMode.ACTIVE:
            raise preflight_error("arm-active")
        return


def release(arm: WamArm, link: CanLink) -> None:
    """Idle an arm that got torques from here, and give the bus back.

    Any other arm is left as it is: another program may hold it.
    """
    if arm.sent_ns:
        arm.close()
    else:
        link.close()
