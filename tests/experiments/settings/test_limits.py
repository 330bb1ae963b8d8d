from dataclasses import MISSING, fields

from acquisition.control_loop.guard import GuardLimits
from experiments.settings.load import load_settings
from experiments.settings.rig import LimitSection

OF_THE_ARM = {"q_lower", "q_upper"}


def test_every_limit_of_the_guard_without_a_default_is_set_by_rig_toml():
    required = {f.name for f in fields(GuardLimits) if f.default is MISSING}
    assert required - OF_THE_ARM == set(load_settings(None).rig.limits.of_guard())


def test_limits_between_trials_are_not_the_guards():
    others = set(LimitSection.model_fields) - {f.name for f in fields(GuardLimits)}
    assert others == {"tare_spread", "residual", "free_disk_gb"}
