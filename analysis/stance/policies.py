"""Four policies of a stance: none, constant mu, avoid-slip, and an oracle.

avoid-slip chooses the load and the traction by P(slip | F_t, F_n) of the ground: the
smallest load at which the peak has half the risk that may be taken, or else all of it;
on ground where no load buys that, the load beyond which another newton brings less than
3 %, and the traction at the risk, for as long as the impulse takes. A foot under which
the ground begins to give - it has crept 6 mm and still moves, or hurries - is eased and
pressed: a tenth less traction and a tenth more load every 20 ms until it rests. From
then on its traction grows by 1 N/s, but only where what is left of the impulse would
not come within 3 s. A foot that slips all the same is let go, and pushes again from 0.8
of what failed once it rests.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from math import isnan
from typing import Final

from analysis.stance.interface import (
    ENOUGH,
    FAST,
    LEAST_F_N,
    LONGEST,
    MOST_F_N,
    MOVED,
    StanceCommand,
    StanceForesight,
    StancePhase,
    StancePolicy,
    StanceRequest,
    StanceSample,
    gives_way,
)

AS_STANDING = 4.0  # N, load of a foot that nobody presses
CONSTANT_MU = 0.5
_LOAD_STEP = 0.5  # N, between loads that are compared
_GAIN = 0.03  # of the traction by another newton of load, below which none is added
_OWN_SHARE = 0.5  # of the risk, where load can buy it
_OF_CAPACITY = 0.75  # that the oracle takes
_STILL, _REST = 0.01, 0.15  # m/s, s: a foot that slipped rests
_LESS = 0.8  # of what failed
# Of traction and load, every 20 ms until the foot rests. More load bears more on a
# plate that was taken for better ground; on stones it does little good or harm.
_EASED, _PRESSED = 0.9, 1.1
_GROWTH = 0.02  # N, every 20 ms: of an eased foot that would not be done in 3 s
_LET_GO = 100.0  # N/s: as fast as the law of the sole lets go
_SETTLED = 0.06  # s after what was asked for, until the force is gone
_PUSHING = StancePhase.PUSH, StancePhase.EASED


def no_policy(
    sample: StanceSample, foresight: StanceForesight, request: StanceRequest
) -> StanceCommand:
    """Ask for what is wanted under 4 N, whatever happens."""
    del foresight
    return _as_asked(sample, request, AS_STANDING)


def constant_mu(
    sample: StanceSample, foresight: StanceForesight, request: StanceRequest
) -> StanceCommand:
    """Ask for what is wanted under the load at which mu = 0.5 bears its peak."""
    del foresight
    load = min(max(request.peak / CONSTANT_MU, LEAST_F_N), MOST_F_N)
    return _as_asked(sample, request, load)


def avoid_slip(
    sample: StanceSample, foresight: StanceForesight, request: StanceRequest
) -> StanceCommand:
    """Take the asked risk and no more; longer, where the ground bears less."""
    last, t = sample.last, sample.t
    if last.phase is StancePhase.LOAD:
        return _loading(sample, foresight, request)
    if t >= LONGEST or last.phase is StancePhase.DONE:
        return replace(last, F_t=0.0, phase=StancePhase.DONE)
    if last.phase is StancePhase.BACK_OFF:
        return _backing_off(sample)
    if sample.x - last.x0 > MOVED or sample.v_t > FAST:
        return replace(
            last, F_t=0.0, phase=StancePhase.BACK_OFF, since=t, most=_LESS * last.most
        )
    if last.phase in _PUSHING and gives_way(sample.x - last.x0, sample.v_t):
        return _easing(last)
    return _pushing(sample, request, _LET_GO)


def oracle(
    sample: StanceSample, foresight: StanceForesight, request: StanceRequest
) -> StanceCommand:
    """Take three quarters of what the ground truly bears; only a simulation tells."""
    command = avoid_slip(sample, _uninformed(foresight), request)
    most = min(request.peak, _OF_CAPACITY * foresight.capacity)
    if command.phase not in _PUSHING:
        return replace(command, F_n=MOST_F_N)
    return replace(command, F_n=MOST_F_N, F_t=min(command.F_t, most), most=most)


POLICIES: Final[Mapping[str, StancePolicy]] = {
    "avoid-slip": avoid_slip,
    "constant-mu": constant_mu,
    "none": no_policy,
    "oracle": oracle,
}


def planned(foresight: StanceForesight, request: StanceRequest) -> tuple[float, float]:
    """Return load and largest traction [N] of a stance at the asked risk.

    Without any known terrain it is that of constant mu. That stances so far held more
    than was learnt raises the traction; it never lightens the load.
    """
    if not foresight.is_known:
        return min(max(request.peak / CONSTANT_MU, LEAST_F_N), MOST_F_N), request.peak
    loads = _loads()
    learnt = replace(foresight, scale=min(foresight.scale, 1.0))
    for risk in (_OWN_SHARE * request.risk, request.risk):
        for load in loads:
            if learnt.risk(request.peak, load) <= risk:
                return load, request.peak
    forces = [
        min(foresight.available(load, request.risk), request.peak) for load in loads
    ]
    for load, force, more in zip(loads, forces, forces[1:], strict=False):
        if more - force < _GAIN * _LOAD_STEP * force:
            return load, force
    return loads[-1], forces[-1]


@lru_cache
def _loads() -> tuple[float, ...]:
    count = round((MOST_F_N - LEAST_F_N) / _LOAD_STEP)
    return tuple(LEAST_F_N + _LOAD_STEP * k for k in range(count + 1))


def _uninformed(foresight: StanceForesight) -> StanceForesight:
    """Return foresight that knows no terrain: the plan of constant mu."""
    return StanceForesight({}, {}, capacity=foresight.capacity)


def _as_asked(
    sample: StanceSample, request: StanceRequest, load: float
) -> StanceCommand:
    """Ask for the peak until the impulse is delivered, whatever the foot does."""
    last = sample.last
    if not sample.is_loaded:
        return StanceCommand(0.0, load, StancePhase.LOAD, most=request.peak)
    if last.phase is StancePhase.LOAD:
        return replace(last, phase=StancePhase.PUSH, since=sample.t)
    if sample.t >= LONGEST or last.phase is StancePhase.DONE:
        return replace(last, F_t=0.0, phase=StancePhase.DONE)
    return _pushing(sample, request, request.rate)


def _loading(
    sample: StanceSample, foresight: StanceForesight, request: StanceRequest
) -> StanceCommand:
    """Plan once, then wait for the load."""
    last = sample.last
    if isnan(last.most):
        load, most = planned(foresight, request)
        last = StanceCommand(0.0, load, StancePhase.LOAD, most=most)
    if not sample.is_loaded:
        return last
    return replace(last, phase=StancePhase.PUSH, since=sample.t, x0=sample.x)


def _pushing(
    sample: StanceSample, request: StanceRequest, fall: float
) -> StanceCommand:
    """Push until what is left of the impulse comes by letting go at `fall` [N/s]."""
    last, rate = sample.last, request.rate
    left = request.impulse - sample.impulse
    is_late = last.most * (LONGEST - sample.t) < left
    if last.phase is StancePhase.EASED and is_late:
        last = replace(last, most=min(last.most + _GROWTH, request.peak))
    if last.phase in _PUSHING:
        if last.F_t**2 < 2.0 * fall * left:
            force = min(rate * (sample.t - last.since), last.most)
            return replace(last, F_t=force)
        last = replace(last, phase=StancePhase.RELEASE, since=sample.t, most=last.F_t)
    force = last.most - fall * (sample.t - last.since)
    is_over = force <= 0.0 and sample.t > last.since + last.most / fall + _SETTLED
    if is_over and sample.impulse < ENOUGH * request.impulse:
        # The ground gave less than it was asked for: once more.
        return replace(last, phase=StancePhase.PUSH, since=sample.t, F_t=0.0)
    phase = StancePhase.DONE if is_over else StancePhase.RELEASE
    return replace(last, F_t=max(force, 0.0), phase=phase)


def _easing(last: StanceCommand) -> StanceCommand:
    """Take less traction and press harder."""
    most = _EASED * min(last.F_t, last.most)
    load = min(_PRESSED * last.F_n, MOST_F_N)
    return replace(last, F_t=most, F_n=load, phase=StancePhase.EASED, most=most)


def _backing_off(sample: StanceSample) -> StanceCommand:
    """Wait until the foot rests, then push anew from where it is."""
    last, t = sample.last, sample.t
    if abs(sample.v_t) > _STILL:
        return replace(last, F_t=0.0, since=t)
    if t - last.since < _REST:
        return replace(last, F_t=0.0)
    return replace(last, phase=StancePhase.EASED, since=t, x0=sample.x, F_t=0.0)
