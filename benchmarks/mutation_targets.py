"""Modules to mutate, each with the tests that must kill the mutations."""

_LOOP, _LOOP_TESTS = "acquisition/control_loop", "tests/acquisition/control_loop"
_FILE, _FILE_TESTS = "acquisition/trial_file", "tests/acquisition/trial_file"
_CONTROL, _CONTROL_TESTS = "wam/control", "tests/wam/control"
_DRIVER, _DRIVER_TESTS = "wam/driver", "tests/wam/driver"
_RUN, _RUN_TESTS = "experiments/run", "tests/experiments/run"
_POSES = (
    "tests/wam/calibration/test_gravity_poses.py",
    "tests/experiments/run/test_free_space_of_rig.py",
    "tests/experiments/calibration/test_pose_file.py",
)
_SALVAGED = (
    f"{_FILE_TESTS}/test_recover.py",
    f"{_FILE_TESTS}/test_damaged_blocks.py",
    f"{_FILE_TESTS}/test_damaged_files.py",
    f"{_FILE_TESTS}/test_hostile_files.py",
    "tests/corpus/test_stated_limits.py",
)
_PUBLISHED = (
    "tests/experiments/export/test_checksums.py",
    "tests/experiments/export/test_publication_check.py",
)

TESTS = {
    f"{_LOOP}/guard.py": (
        f"{_LOOP_TESTS}/test_guard.py",
        f"{_LOOP_TESTS}/test_cycle.py",
    ),
    f"{_LOOP}/motion.py": (
        f"{_LOOP_TESTS}/test_motion.py",
        f"{_LOOP_TESTS}/test_guard.py",
        f"{_LOOP_TESTS}/test_cycle.py",
    ),
    f"{_LOOP}/cycle.py": (
        f"{_LOOP_TESTS}/test_cycle.py",
        f"{_CONTROL_TESTS}/test_move_in_the_cycle.py",
    ),
    f"{_LOOP}/states.py": (
        f"{_LOOP_TESTS}/test_states.py",
        f"{_LOOP_TESTS}/test_cycle.py",
    ),
    f"{_LOOP}/faults.py": (f"{_LOOP_TESTS}/test_faults.py",),
    f"{_LOOP}/contact.py": (
        f"{_LOOP_TESTS}/test_contact.py",
        f"{_LOOP_TESTS}/test_cycle.py",
    ),
    f"{_LOOP}/limits.py": (
        f"{_LOOP_TESTS}/test_torque_limiter.py",
        f"{_LOOP_TESTS}/test_guard.py",
        f"{_LOOP_TESTS}/test_contact.py",
    ),
    f"{_LOOP}/powered_tests.py": (f"{_CONTROL_TESTS}/test_powered_test.py",),
    "acquisition/ipc/loop_server.py": ("tests/acquisition/ipc/test_loop_server.py",),
    f"{_FILE}/salvage.py": _SALVAGED,
    f"{_FILE}/recover.py": _SALVAGED,
    f"{_CONTROL}/controller.py": (
        f"{_CONTROL_TESTS}/test_controller.py",
        f"{_CONTROL_TESTS}/test_move_in_the_cycle.py",
        f"{_CONTROL_TESTS}/test_friction_compensation.py",
    ),
    f"{_CONTROL}/position_control.py": (
        f"{_CONTROL_TESTS}/test_position_hold.py",
        f"{_CONTROL_TESTS}/test_joint_move.py",
        f"{_CONTROL_TESTS}/test_motor_watch.py",
    ),
    f"{_CONTROL}/joint_lock.py": (
        f"{_CONTROL_TESTS}/test_joint_lock.py",
        f"{_CONTROL_TESTS}/test_controller.py",
    ),
    f"{_CONTROL}/friction_compensation.py": (
        f"{_CONTROL_TESTS}/test_friction_compensation.py",
    ),
    f"{_CONTROL}/powered_tests.py": (f"{_CONTROL_TESTS}/test_powered_test.py",),
    f"{_CONTROL}/soft_walls.py": (f"{_CONTROL_TESTS}/test_soft_walls.py",),
    f"{_DRIVER}/transmission.py": (f"{_DRIVER_TESTS}/test_transmission.py",),
    f"{_DRIVER}/status_poller.py": (
        f"{_DRIVER_TESTS}/test_status_poller.py",
        f"{_DRIVER_TESTS}/test_property_watch.py",
        f"{_DRIVER_TESTS}/test_command_watch.py",
        f"{_DRIVER_TESTS}/test_arm.py",
    ),
    f"{_DRIVER}/command_watch.py": (f"{_DRIVER_TESTS}/test_command_watch.py",),
    f"{_DRIVER}/lost_positions.py": (f"{_DRIVER_TESTS}/test_lost_writes.py",),
    f"{_DRIVER}/joint_estimator.py": (
        f"{_DRIVER_TESTS}/test_joint_estimator.py",
        f"{_DRIVER_TESTS}/test_arm.py",
        f"{_DRIVER_TESTS}/test_lost_replies.py",
    ),
    f"{_DRIVER}/cyclic_io.py": (
        f"{_DRIVER_TESTS}/test_late_replies.py",
        f"{_DRIVER_TESTS}/test_lost_replies.py",
        f"{_DRIVER_TESTS}/test_arm.py",
    ),
    f"{_DRIVER}/property_watch.py": (f"{_DRIVER_TESTS}/test_property_watch.py",),
    f"{_DRIVER}/puck_properties.py": (f"{_DRIVER_TESTS}/test_puck_properties.py",),
    f"{_DRIVER}/startup.py": (
        f"{_DRIVER_TESTS}/test_startup.py",
        f"{_DRIVER_TESTS}/test_puck_properties.py",
        f"{_DRIVER_TESTS}/test_generations.py",
        f"{_DRIVER_TESTS}/test_lenient_start.py",
        f"{_DRIVER_TESTS}/test_safety_limits.py",
        f"{_DRIVER_TESTS}/test_lost_writes.py",
    ),
    f"{_DRIVER}/survey.py": (f"{_DRIVER_TESTS}/test_survey.py",),
    f"{_DRIVER}/home.py": (
        f"{_DRIVER_TESTS}/test_home_check.py",
        "tests/experiments/preflight/test_zero_check.py",
    ),
    f"{_DRIVER}/pendant.py": (
        f"{_DRIVER_TESTS}/test_safety_module.py",
        f"{_DRIVER_TESTS}/test_lenient_start.py",
    ),
    f"{_DRIVER}/safety_module.py": (
        f"{_DRIVER_TESTS}/test_safety_module.py",
        f"{_DRIVER_TESTS}/test_safety_limits.py",
        f"{_DRIVER_TESTS}/test_lenient_start.py",
        f"{_DRIVER_TESTS}/test_arm.py",
        "tests/experiments/rig/test_build_limits.py",
    ),
    "wam/calibration/arm_identity.py": (
        "tests/experiments/settings/test_calibration_quality.py",
        "tests/experiments/preflight/test_identity.py",
    ),
    "wam/model/clearance.py": ("tests/wam/model/test_clearance.py",),
    "wam/calibration/free_space.py": _POSES,
    "wam/calibration/poses.py": _POSES,
    "wam/bus/frames.py": ("tests/wam/bus/test_frames.py",),
    "ft_sensor/payload.py": (
        "tests/ft_sensor/test_payload.py",
        "tests/ft_sensor/test_observer.py",
    ),
    "ft_sensor/tare.py": ("tests/ft_sensor/test_tare.py",),
    "ft_sensor/weighing.py": ("tests/ft_sensor/test_tare.py",),
    "experiments/session/reducer.py": ("tests/experiments/session/test_reducer.py",),
    "experiments/session/kept_files.py": (
        "tests/experiments/session/test_kept_file_comparison.py",
    ),
    "experiments/export/checksums.py": _PUBLISHED,
    "experiments/export/publication_check.py": _PUBLISHED,
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
# Equivalent mutations: they change nothing that a test could observe, with the reason.
_AT_REST = "at the boundary itself both branches give the same numbers"
_BELOW = "a difference of nanoseconds or part of a millisecond where milliseconds count"
_TUNED = "one of many equally good choices: the resulting poses are tested instead"
_SHORTCUT = "a fast path that skips the loop; the loop gives the same result"
EQUIVALENT: dict[tuple[str, str], str] = {
    (
        f"{_LOOP}/guard.py",
        "if are_within(values, limits): -> pass",
    ): _SHORTCUT,
    (
        f"{_LOOP}/motion.py",
        "if are_within(values, limits): -> pass",
    ): _SHORTCUT,
    (
        f"{_LOOP}/limits.py",
        "if is_gentle and are_within(values, limits): -> pass",
    ): _SHORTCUT,
    (
        f"{_CONTROL}/soft_walls.py",
        "if not may_arm and are_between(self._lower, q, self._upper): -> pass",
    ): _SHORTCUT,
    (
        f"{_LOOP}/contact.py",
        "if since_ns == state.since_ns and points is state.points: -> pass",
    ): "an equal state, created anew in every cycle",
    (
        f"{_CONTROL}/position_control.py",
        "elif abs(angles[i] - self._wanted[i]) > self._stuck_advance[i]: -> elif "
        "abs(angles[i] - self._wanted[i]) >= self._stuck_advance[i]:",
    ): _AT_REST,
    (
        "wam/model/clearance.py",
        "if (distances < limits).any(): -> if (distances <= limits).any():",
    ): _AT_REST,
    (
        f"{_CONTROL}/friction_compensation.py",
        "if now == before: -> pass",
    ): "a step of 0 bends no bristle",
    (
        f"{_CONTROL}/position_control.py",
        "elif t <= T - ramp: -> elif t < T - ramp:",
    ): _AT_REST,
    (
        f"{_DRIVER}/home.py",
        "wrapped = (difference + turn / 2) % turn - turn / 2 -> wrapped = "
        "(difference - turn / 2) % turn - turn / 2",
    ): "plus and minus half a turn are equal modulo a whole turn",
    (
        f"{_DRIVER}/safety_module.py",
        "while self._clock.now_ns() < deadline_ns: -> "
        "while self._clock.now_ns() <= deadline_ns:",
    ): _BELOW,
    (
        "ft_sensor/payload.py",
        "if force_7.ndim == 1: -> pass",
    ): "the general product gives the same for a single reading, slower",
    (
        "acquisition/ipc/loop_server.py",
        "if self._cycle.is_recording and now_ns - heartbeats.last_ns(_RECORDER) > "
        "SILENT_NS: -> if self._cycle.is_recording and "
        "now_ns - heartbeats.last_ns(_RECORDER) >= SILENT_NS:",
    ): _BELOW,
    (
        f"{_CONTROL}/friction_compensation.py",
        "self._rested_ns = -_FADE_NS -> self._rested_ns = +_FADE_NS",
    ): "before the first push the fading torque is always 0",
    (
        f"{_CONTROL}/friction_compensation.py",
        "if load and (unload := (load_at - abs(load_torque))) > 0.0: -> if load "
        "and (unload := (load_at - abs(load_torque))) >= 0.0:",
    ): "a load reduced by 0 removes nothing",
    (
        f"{_CONTROL}/friction_compensation.py",
        "if z * step > 0.0 and (bent := abs(z)) > ELASTIC: -> "
        "if z / step > 0.0 and (bent := abs(z)) > ELASTIC:",
    ): "a quotient has the sign of the product",
    (
        f"{_CONTROL}/friction_compensation.py",
        "sign = 1 if z > _BENT else -1 if z < -_BENT else 0 -> sign = 1 if z > "
        "_BENT else -1 if z <= -_BENT else 0",
    ): _AT_REST,
    (
        f"{_CONTROL}/friction_compensation.py",
        "if len(changes) == _SWINGS and now_ns - changes[0] < _SWING_NS: -> if "
        "len(changes) == _SWINGS and now_ns - changes[0] <= _SWING_NS:",
    ): _BELOW,
    (
        f"{_CONTROL}/friction_compensation.py",
        "if z * step > 0.0 and (bent := abs(z)) > ELASTIC: -> "
        "if z * step > 0.0 and (bent := abs(z)) >= ELASTIC:",
    ): "at the onset of sliding the plastic share of a bristle is 0",
    (
        f"{_CONTROL}/friction_compensation.py",
        "level = forward if z > 0.0 else backward -> "
        "level = forward if z >= 0.0 else backward",
    ): "an unbent bristle exerts no force, whatever its level",
    (
        f"{_CONTROL}/friction_compensation.py",
        "sign = 1 if z > _BENT else -1 if z < -_BENT else 0 -> sign = 1 if z >= "
        "_BENT else -1 if z < -_BENT else 0",
    ): _AT_REST,
    (
        f"{_CONTROL}/position_control.py",
        "if t <= 0.0: -> if t < 0.0:",
    ): _AT_REST,
    (
        f"{_CONTROL}/position_control.py",
        "if length == 0.0 or t >= T: -> if length == 0.0 or t > T:",
    ): _AT_REST,
    (
        f"{_CONTROL}/soft_walls.py",
        "inward = 1.0 if depth > 0.0 else -1.0 -> "
        "inward = 1.0 if depth >= 0.0 else -1.0",
    ): "a joint at depth 0 is not inside a wall",
    (
        f"{_CONTROL}/soft_walls.py",
        "if lower <= angle <= upper: -> if lower < angle <= upper:",
    ): _AT_REST,
    (
        f"{_CONTROL}/soft_walls.py",
        "if push > 0.0: -> if push >= 0.0:",
    ): "a push of 0 leaves the torque unchanged on either branch",
    (
        f"{_DRIVER}/status_poller.py",
        "if reply.value is None: -> pass",
    ): "a decoded reply has a value; the check is for the type checker",
    (
        f"{_DRIVER}/joint_estimator.py",
        "ahead = elapsed if elapsed < _LONGEST_EXTRAPOLATION else "
        "_LONGEST_EXTRAPOLATION -> ahead = elapsed if elapsed <= "
        "_LONGEST_EXTRAPOLATION else _LONGEST_EXTRAPOLATION",
    ): _AT_REST,
    (
        "wam/calibration/free_space.py",
        "return bool(heights.min() >= min(floor, heights[0], heights[-1]) - _SLACK) -> "
        "return bool(heights.min() > min(floor, heights[0], heights[-1]) - _SLACK)",
    ): _AT_REST,
    (
        "wam/calibration/poses.py",
        "reachable = [q for q in drawn[heights > space.floor] if all((space.is_free("
        "q + side) for side in sides))] -> "
        "reachable = [q for q in drawn[heights > space.floor] if all((space.is_free("
        "q - side) for side in sides))]",
    ): "the sides are the same on both sides",
    (
        "wam/calibration/poses.py",
        "drawn = np.array(UPRIGHT) + REACH * rng.uniform(-1.0, 1.0, (_CANDIDATES, 7)) "
        "-> "
        "drawn = np.array(UPRIGHT) - REACH * rng.uniform(-1.0, 1.0, (_CANDIDATES, 7))",
    ): _TUNED,
    (
        f"{_RUN}/tare.py",
        "while still < STILL_SECONDS: -> while still <= STILL_SECONDS:",
    ): "a sum of ticks of 0.02 s is never 0.3 s to the last bit",
    (
        f"{_RUN}/ready.py",
        "if (clock.now_ns() - start_ns) * 1e-09 > PATIENCE: -> "
        "if (clock.now_ns() - start_ns) * 1e-09 >= PATIENCE:",
    ): _AT_REST,
    (
        f"{_CONTROL}/position_control.py",
        "elif t < ramp: -> elif t <= ramp:",
    ): _AT_REST,
    (
        f"{_CONTROL}/powered_tests.py",
        "height = min(seconds / up, 1.0) if down <= 0.0 else 1.0 - down / up -> "
        "height = min(seconds / up, 1.0) if down < 0.0 else 1.0 - down / up",
    ): _AT_REST,
    (
        f"{_CONTROL}/powered_tests.py",
        "limit = low if travel < low else high -> limit = low if travel <= low "
        "else high",
    ): "a joint at the end of its range was already accepted before",
    (
        f"{_CONTROL}/position_control.py",
        "if length * self.acceleration < self.speed ** 2: -> "
        "if length * self.acceleration <= self.speed ** 2:",
    ): _AT_REST,
    (
        f"{_CONTROL}/position_control.py",
        "if error * rate > 0.0 and (not -_SLOW <= rate <= _SLOW): -> "
        "if error * rate >= 0.0 and (not -_SLOW <= rate <= _SLOW):",
    ): "an unstretched spring exerts no force at any speed",
    (
        "wam/calibration/poses.py",
        "down = [-model.plate_pose(q)[1][2] for q in reachable] -> "
        "down = [+model.plate_pose(q)[1][2] for q in reachable]",
    ): "up carries the same information as down",
    (
        "wam/calibration/poses.py",
        "reachable = [q for q in drawn[heights > space.floor] if all((space.is_free("
        "q + side) for side in sides))] -> "
        "reachable = [q for q in drawn[heights >= space.floor] if all((space.is_free("
        "q + side) for side in sides))]",
    ): _AT_REST,
    (
        "experiments/session/reducer.py",
        "return value if type(value) is int and value > 0 else 0 -> "
        "return value if type(value) is int and value >= 0 else 0",
    ): "0 is 0 either way",
    (
        f"{_LOOP}/contact.py",
        "if growth > limits.contact_growth: -> if growth >= limits.contact_growth:",
    ): _AT_REST,
    (
        f"{_LOOP}/contact.py",
        "if max((dist(point.sole, seen.sole) for point in points)) >= STANDING: -> "
        "if max((dist(point.sole, seen.sole) for point in points)) > STANDING:",
    ): _AT_REST,
    (
        "acquisition/ipc/loop_server.py",
        "elif now_ns - self._orphaned_ns > ORPHAN_NS: -> "
        "elif now_ns - self._orphaned_ns >= ORPHAN_NS:",
    ): _BELOW,
    (
        "acquisition/ipc/loop_server.py",
        "if console_ns > NO_HEARTBEAT_NS and self._cycles % _SOUND_EVERY == 0: -> "
        "if console_ns >= NO_HEARTBEAT_NS and self._cycles % _SOUND_EVERY == 0:",
    ): _BELOW,
    (
        "wam/bus/frames.py",
        "if not -TORQUE_LIMIT <= value <= TORQUE_LIMIT: -> "
        "if not +TORQUE_LIMIT <= value <= TORQUE_LIMIT:",
    ): "clipping leaves values within the limits unchanged",
    (
        "wam/calibration/poses.py",
        "heights = np.min([lowest_height(model, drawn + side) for side in sides], "
        "axis=0) -> heights = np.min([lowest_height(model, drawn - side) for side in "
        "sides], axis=0)",
    ): "the sides are the same on both sides",
}
# NaN makes any sum NaN, whatever the signs.
_TOTAL = "total = sum(facts.q) + sum(facts.qd) + sum(facts.tau)"
_FINITE = "if isfinite(total + seen.foot_speed + seen.joint7_offset):"
for _text, _other in (
    (_TOTAL, _TOTAL.replace("+ sum(facts.qd)", "- sum(facts.qd)")),
    (_TOTAL, _TOTAL.replace("+ sum(facts.tau)", "- sum(facts.tau)")),
    (_FINITE, _FINITE.replace("total +", "total -")),
    (_FINITE, _FINITE.replace("+ seen.joint7", "- seen.joint7")),
):
    EQUIVALENT[f"{_LOOP}/guard.py", f"{_text} -> {_other}"] = (
        "every sum and difference with NaN is NaN"
    )
_BOUNDED = (
    "value = low if desired < low else high if desired > high else desired",
    "bounded.append(-limit if value < -limit else limit if value > limit else value)",
)
for _text in _BOUNDED:
    for _strict, _loose in (("< ", "<= "), ("> ", ">= ")):
        EQUIVALENT[
            f"{_LOOP}/limits.py", f"{_text} -> {_text.replace(_strict, _loose)}"
        ] = "a number at its bound equals the bound"
