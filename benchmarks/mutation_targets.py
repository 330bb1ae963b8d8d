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
_BODIES = (
    "return [('the base', (0, *_capsule(0.12, -BASE_HEIGHT, -0.1))), "
    "('the shoulder', ({}, coal.Sphere(0.15), _translation(0.0, 0.0, 0.0))), "
    "('the upper arm', (3, *_capsule(0.08, 0.08, upper))), "
    "('the elbow', (4, coal.Sphere(0.09), _translation(0.0, 0.0, 0.0))), "
    "('the forearm', (5, *_capsule(0.065, 0.0, fore))), "
    "('the wrist', (6, coal.Sphere(0.065), _translation(0.0, 0.0, 0.0))), "
    "('the foot', (7, *_capsule(0.045, 0.0, end, x, y)))]"
)
_SHORTCUT = "a fast path that skips the loop; the loop gives the same result"
_UNREAD = "overwritten before it is read"
_MARK = "a direction code; it is only compared with the other direction's and 0"
_LIMP = "only joint 7's stiffness of 0 is below either bound, and its limit is 0"
_EIGHTH = "no eighth motor reads it"
_TILTS = "_TILTS = ((5, -1.2), (4, 1.0), (4, -1.0), (5, -0.6))"
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
        f"{_FILE}/salvage.py",
        "latest = (self.last_ns if self.last_ns > 0 else start_ns) + _LONGEST_NS -> "
        "latest = (self.last_ns if self.last_ns > 1 else start_ns) + _LONGEST_NS",
    ): _BELOW,
    (
        f"{_FILE}/recover.py",
        "before = (earliest or 0) - PERIOD_NS -> before = (earliest or 1) - PERIOD_NS",
    ): _BELOW,
    (
        f"{_FILE}/recover.py",
        "start_s = max(0, before + PERIOD_NS - first) / NS_PER_S -> "
        "start_s = max(1, before + PERIOD_NS - first) / NS_PER_S",
    ): _BELOW,
    (
        f"{_CONTROL}/position_control.py",
        "elif abs(angles[i] - self._wanted[i]) > self._stuck_advance[i]: -> elif "
        "abs(angles[i] - self._wanted[i]) >= self._stuck_advance[i]:",
    ): _AT_REST,
    (
        f"{_CONTROL}/soft_walls.py",
        "_ALL_ARMED = 127 -> _ALL_ARMED = 254",
    ): "whether the walls are checked again once all are armed",
    (
        f"{_DRIVER}/property_watch.py",
        "documented = nearest_documented(firmware[node - 1]) -> documented = "
        "nearest_documented(firmware[node - 2])",
    ): "watched properties have the same number in every documented firmware",
    (
        f"{_DRIVER}/property_watch.py",
        "self._next = 0 -> self._next = 1",
    ): "not read before a start; the same line of `begin` is tested",
    (
        f"{_DRIVER}/status_poller.py",
        "self._until_pendant = 0 -> self._until_pendant = 1",
    ): "this cycle requests the mode and the next one the pendant either way",
    (
        f"{_DRIVER}/safety_module.py",
        "_CONFIG_GAP_NS = 10000000 -> _CONFIG_GAP_NS = 20000000",
    ): "a longer gap than required satisfies the requirement",
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
        f"{_DRIVER}/safety_module.py",
        "self._properties.pause(_RETRY_NS // 10) -> "
        "self._properties.pause(_RETRY_NS // 20)",
    ): "the number of requests within a fixed time",
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
        "ft_sensor/tare.py",
        "duration = float(times[-1] - times[0]) * count / (count - 1) if count > "
        "1 else 0.0 -> duration = float(times[-1] - times[0]) * count / (count - "
        "1) if count > 1 else 1.0",
    ): _BELOW,
    (
        "ft_sensor/tare.py",
        "grace = duration / count / 2 if count else 0.0 -> grace = duration / "
        "count / 2 if count else 1.0",
    ): _BELOW,
    (
        f"{_CONTROL}/friction_compensation.py",
        "self._load_torques = [0.0] * 7 -> self._load_torques = [0.0] * 8",
    ): _UNREAD,
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
        "tau *= np.where(self._j2mp != 0.0, free, 1.0).min(axis=1) -> "
        "tau *= np.where(self._j2mp != 0.0, free, 2.0).min(axis=1)",
    ): "every motor turns a joint, and no joint's factor exceeds 1",
    (
        f"{_CONTROL}/friction_compensation.py",
        "self._fading = np.zeros(7) -> self._fading = np.zeros(8)",
    ): _UNREAD,
    (
        f"{_CONTROL}/friction_compensation.py",
        "self._last_sign = [0] * 7 -> self._last_sign = [0] * 8",
    ): _EIGHTH,
    (
        f"{_CONTROL}/friction_compensation.py",
        "self._sign_changes_ns: list[list[int]] = [[] for _ in range(7)] -> "
        "self._sign_changes_ns: list[list[int]] = [[] for _ in range(8)]",
    ): _EIGHTH,
    (
        f"{_CONTROL}/friction_compensation.py",
        "self._load_torques = [0.0] * 7 -> self._load_torques = [1.0] * 7",
    ): _UNREAD,
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
        "sign = 1 if z > _BENT else -1 if z < -_BENT else 0 -> sign = 1 if z > "
        "_BENT else -2 if z < -_BENT else 0",
    ): _MARK,
    (
        f"{_CONTROL}/friction_compensation.py",
        "sign = 1 if z > _BENT else -1 if z < -_BENT else 0 -> sign = 2 if z > "
        "_BENT else -1 if z < -_BENT else 0",
    ): _MARK,
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
        f"{_CONTROL}/position_control.py",
        "self._reach = TORQUE_LIMIT / np.maximum(self.stiffness, 1.0) -> "
        "self._reach = TORQUE_LIMIT / np.maximum(self.stiffness, 2.0)",
    ): _LIMP,
    (
        f"{_CONTROL}/position_control.py",
        "error = spring / np.maximum(self.stiffness, 1.0) -> "
        "error = spring / np.maximum(self.stiffness, 2.0)",
    ): _LIMP,
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
        f"{_LOOP}/contact.py",
        "return 0 < since_ns <= now_ns - LASTING_NS -> "
        "return 1 < since_ns <= now_ns - LASTING_NS",
    ): _BELOW,
    (
        f"{_LOOP}/contact.py",
        "saturated_ms = (now_ns - saturated_ns) / NS_PER_MS "
        "if saturated_ns else 0.0 -> "
        "saturated_ms = (now_ns - saturated_ns) / NS_PER_MS "
        "if saturated_ns else 1.0",
    ): _BELOW,
    (
        f"{_FILE}/salvage.py",
        "return 0.0 if first_ns is None else max(0, last_ns - first_ns) * 1e-09 -> "
        "return 0.0 if first_ns is None else max(1, last_ns - first_ns) * 1e-09",
    ): _BELOW,
    (
        f"{_FILE}/salvage.py",
        "at, first_ns, last_ns = (len(MAGIC), None, 0) -> "
        "at, first_ns, last_ns = (len(MAGIC), None, 1)",
    ): _BELOW,
    (
        f"{_DRIVER}/status_poller.py",
        "if reply.value is None: -> pass",
    ): "a decoded reply has a value; the check is for the type checker",
    (
        f"{_DRIVER}/status_poller.py",
        "self._until_mode = 0 -> self._until_mode = 1",
    ): "the first cycle sends the request either way",
    (
        f"{_DRIVER}/joint_estimator.py",
        "ahead = elapsed if elapsed < _LONGEST_EXTRAPOLATION else "
        "_LONGEST_EXTRAPOLATION -> ahead = elapsed if elapsed <= "
        "_LONGEST_EXTRAPOLATION else _LONGEST_EXTRAPOLATION",
    ): _AT_REST,
    (
        "wam/model/clearance.py",
        "slab = coal.Box(6.0, 6.0, 1.0) -> slab = coal.Box(7.0, 6.0, 1.0)",
    ): "the floor reaches beyond the arm either way",
    (
        "wam/model/clearance.py",
        "slab = coal.Box(6.0, 6.0, 1.0) -> slab = coal.Box(6.0, 7.0, 1.0)",
    ): "the floor reaches beyond the arm either way",
    (
        "wam/model/clearance.py",
        "indices[_FLOOR] = self._add(_FLOOR, 0, slab, _translation(0.0, 0.0, "
        "floor - 0.5)) -> indices[_FLOOR] = self._add(_FLOOR, 0, slab, "
        "_translation(0.0, 1.0, floor - 0.5))",
    ): "the floor reaches beyond the arm either way",
    (
        "wam/model/clearance.py",
        f"{_BODIES.format(1)} -> {_BODIES.format(2)}",
    ): "the axes of joints 1 and 2 meet at the centre of the sphere",
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
        "wam/calibration/free_space.py",
        "return np.stack([x, y, reach * np.cos(q[:, 1]) - width], axis=-1) -> "
        "return np.stack([x, y, reach * np.cos(q[:, 1]) - width], axis=+1)",
    ): "of two axes, the last one is axis 1",
    ("wam/calibration/poses.py", "_CANDIDATES = 1000 -> _CANDIDATES = 2000"): _TUNED,
    ("wam/calibration/poses.py", "_SEED = 7 -> _SEED = 8"): _TUNED,
    (
        "wam/calibration/poses.py",
        "drawn = np.array(UPRIGHT) + REACH * rng.uniform(-1.0, 1.0, (_CANDIDATES, 7)) "
        "-> "
        "drawn = np.array(UPRIGHT) - REACH * rng.uniform(-1.0, 1.0, (_CANDIDATES, 7))",
    ): _TUNED,
    **{
        ("wam/calibration/poses.py", f"{_TILTS} -> {other}"): _TUNED
        for other in (
            _TILTS.replace("(5, -1.2)", "(6, -1.2)"),
            _TILTS.replace("(4, -1.0)", "(5, -1.0)"),
            _TILTS.replace("(5, -0.6)", "(5, +0.6)"),
        )
    },
    (
        "wam/calibration/poses.py",
        "information = 0.001 * np.eye(parameters) -> "
        "information = 1.001 * np.eye(parameters)",
    ): _TUNED,
    (
        "wam/calibration/poses.py",
        "blocks = [np.append(direction, 1.0)[None, :] for direction in down] -> "
        "blocks = [np.append(direction, 2.0)[None, :] for direction in down]",
    ): _TUNED,
    (
        f"{_RUN}/tare.py",
        "residual = residual_force(tared, known) if known is not None else 0.0 -> "
        "residual = residual_force(tared, known) if known is not None else 1.0",
    ): "not read if the bias is unknown",
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
        "wam/calibration/free_space.py",
        "reach, width = (constants.d[2], abs(constants.a[2])) -> "
        "reach, width = (constants.d[2], abs(constants.a[3]))",
    ): "the elbow axis has the same offset from the upper arm and the forearm",
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
