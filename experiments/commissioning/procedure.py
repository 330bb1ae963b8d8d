"""The steps of a commissioning, C0 to C14, and which of them share a connection."""

from collections.abc import Mapping

from experiments.commissioning.bus import IDENTITY, LISTEN, TIMING
from experiments.commissioning.configuration import CONFIGURATION
from experiments.commissioning.container import CONTAINER
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.lock_clock import LOCK_AND_CLOCK
from experiments.commissioning.manual_joints import BY_HAND
from experiments.commissioning.rest_pose import (
    GRAVITY_RAMP,
    LIFT,
    RAMPS,
    REST_POSE,
)
from experiments.commissioning.scales import PLATE
from experiments.commissioning.step import Step
from experiments.commissioning.stop_circuit import STOP_CIRCUIT
from experiments.commissioning.weights import HUNG_WEIGHT, OWN_WEIGHT

# Steps that share one connection to the rig. The stop button cuts power and positions.
CONNECTIONS: tuple[tuple[Step, ...], ...] = (
    (CONFIGURATION, LISTEN, IDENTITY, TIMING),
    (STOP_CIRCUIT,),
    (BY_HAND, OWN_WEIGHT, HUNG_WEIGHT),
    (REST_POSE, RAMPS, LIFT, GRAVITY_RAMP),
    (LOCK_AND_CLOCK,),
    (CONTAINER,),
    (PLATE,),
)
STEPS: Mapping[StepId, Step] = {
    step.id: step for sitting in CONNECTIONS for step in sitting
}
