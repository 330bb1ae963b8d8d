"""Modules whose errors are sown, each with the tests that have to notice."""

_LOOP, _LOOP_TESTS = "acquisition/control_loop", "tests/acquisition/control_loop"
_FILE, _FILE_TESTS = "acquisition/trial_file", "tests/acquisition/trial_file"
_CONTROL, _CONTROL_TESTS = "wam/control", "tests/wam/control"
_DRIVER, _DRIVER_TESTS = "wam/driver", "tests/wam/driver"
_RUN, _RUN_TESTS = "experiments/run", "tests/experiments/run"
_POSES = (
    "tests/wam/calibration/test_gravity_poses.py",
    "tests/experiments/calibrating/test_surroundings.py",
)
_SALVAGED = (
    f"{_FILE_TESTS}/test_recover.py",
    f"{_FILE_TESTS}/test_damaged_files.py",
    f"{_FILE_TESTS}/test_hostile_files.py",
)

TESTS = {
    f"{_LOOP}/guard.py": (f"{_LOOP_TESTS}/test_guard.py",),
    f"{_LOOP}/cycle.py": (
        f"{_LOOP_TESTS}/test_cycle.py",
        f"{_CONTROL_TESTS}/test_move_in_the_cycle.py",
    ),
    f"{_LOOP}/states.py": (f"{_LOOP_TESTS}/test_states.py",),
    f"{_LOOP}/faults.py": (f"{_LOOP_TESTS}/test_faults.py",),
    f"{_LOOP}/contact.py": (
        f"{_LOOP_TESTS}/test_contact.py",
        f"{_LOOP_TESTS}/test_cycle.py",
    ),
    f"{_LOOP}/limits.py": (
        f"{_LOOP_TESTS}/test_torque_limiter.py",
        f"{_LOOP_TESTS}/test_guard.py",
    ),
    "acquisition/ipc/loop_server.py": ("tests/acquisition/ipc/test_loop_server.py",),
    f"{_FILE}/salvage.py": _SALVAGED,
    f"{_FILE}/recover.py": _SALVAGED,
    f"{_CONTROL}/controller.py": (
        f"{_CONTROL_TESTS}/test_controller.py",
        f"{_CONTROL_TESTS}/test_move_in_the_cycle.py",
    ),
    f"{_CONTROL}/position_control.py": (
        f"{_CONTROL_TESTS}/test_position_hold.py",
        f"{_CONTROL_TESTS}/test_joint_move.py",
    ),
    f"{_CONTROL}/joint_lock.py": (f"{_CONTROL_TESTS}/test_joint_lock.py",),
    f"{_CONTROL}/soft_walls.py": (f"{_CONTROL_TESTS}/test_soft_walls.py",),
    f"{_DRIVER}/transmission.py": (f"{_DRIVER_TESTS}/test_transmission.py",),
    f"{_DRIVER}/status_poller.py": (
        f"{_DRIVER_TESTS}/test_status_poller.py",
        f"{_DRIVER_TESTS}/test_arm.py",
    ),
    f"{_DRIVER}/joint_estimator.py": (
        f"{_DRIVER_TESTS}/test_arm.py",
        f"{_DRIVER_TESTS}/test_lost_replies.py",
    ),
    f"{_DRIVER}/startup.py": (
        f"{_DRIVER_TESTS}/test_startup.py",
        f"{_DRIVER_TESTS}/test_home_check.py",
        "tests/experiments/preflight/test_zero_check.py",
        f"{_DRIVER_TESTS}/test_generations.py",
        f"{_DRIVER_TESTS}/test_safety_limits.py",
    ),
    f"{_DRIVER}/safety_module.py": (
        f"{_DRIVER_TESTS}/test_safety_module.py",
        f"{_DRIVER_TESTS}/test_safety_limits.py",
        f"{_DRIVER_TESTS}/test_arm.py",
    ),
    "wam/model/clearance.py": ("tests/wam/model/test_clearance.py",),
    "wam/calibration/free_space.py": _POSES,
    "wam/calibration/poses.py": _POSES,
    "wam/bus/frames.py": ("tests/wam/bus/test_frames.py",),
    "ft_sensor/payload.py": ("tests/ft_sensor/test_payload.py",),
    "ft_sensor/tare.py": ("tests/ft_sensor/test_tare.py",),
    "experiments/session/reducer.py": ("tests/experiments/session/test_reducer.py",),
    "experiments/session/crash_recovery.py": (
        "tests/experiments/session/test_crash_recovery.py",
    ),
    f"{_RUN}/stop.py": (f"{_RUN_TESTS}/test_stop_flag.py",),
    f"{_RUN}/ready.py": (
        f"{_RUN_TESTS}/test_activation.py",
        f"{_RUN_TESTS}/test_flow_steps.py",
    ),
    f"{_RUN}/tare.py": (f"{_RUN_TESTS}/test_tare.py",),
    "analysis/data/prepare.py": ("tests/analysis/data/test_prepare.py",),
}
EQUIVALENT: dict[tuple[str, str], str] = {}
