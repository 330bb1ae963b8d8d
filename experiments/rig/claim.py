"""Claim of an arm: no other master on the bus, arm inactive; and its release.

An arm that never received a torque is released unchanged.
"""

from acquisition.clock import Clock
from acquisition.devices import SafetyMode
from acquisition.errors import LinkTimeoutError
from experiments.messages import preflight_error
from wam.bus.link import CanLink
from wam.driver.arm import WamArm

LISTEN_NS = 50_000_000  # 25 cycles of another master at 500 Hz
_QUESTIONS = 3  # a lost reply must not let the start-up write to an active arm
_LOOK_NS = 5_000_000  # polling period, so that no socket buffer overflows


def check_alone(link: CanLink, clock: Clock, bus: str) -> None:
    """Listen for 50 ms without sending anything.

    Args:
        link: link to the bus.
        clock: clock of the listening time.
        bus: name of the bus in the message.

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
    """Read only the mode of the safety module, three times at most.

    Silence is left to the start-up, whose message is more precise.

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
    """Idle an arm that received torques from this program, and close the bus.

    Any other arm is left unchanged: another program may hold it.
    """
    if arm.sent_ns:
        arm.close()
    else:
        link.close()
