"""Guard limits for tests; each test overrides the limits that it checks."""

from acquisition.control_loop.limits import GuardLimits


def guard_limits(**changes):
    """Return guard limits of an arm, with `changes` by name."""
    limits = {
        "q_lower": (-2.6, -2.0, -2.8, -0.9, -4.76, -1.6, -3.0),
        "q_upper": (2.6, 2.0, 2.8, 3.1, 1.24, 1.6, 3.0),
        "speed": (1.5, 1.5, 2.0, 2.5, 4.0, 4.0, 4.0),
        "torque": (20.0, 45.0, 15.0, 15.0, 2.5, 2.5, 1.3),
        "foot_speed": 0.8,
        "joint7_mrad": 50.0,
        "ft_stale_ms": 6.0,
        "ft_stop_ms": 20.0,
        "ft_saturated_ms": 100.0,
        "contact_force": 100.0,
        "contact_force_hold": 150.0,
        "contact_moment": 10.0,
        "contact_moment_hold": 15.0,
        "contact_growth": 40.0,
        "late_per_second": 10,
    }
    return GuardLimits(**(limits | changes))
