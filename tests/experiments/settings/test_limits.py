from dataclasses import MISSING, fields

import pytest
from pydantic import ValidationError

from acquisition.control_loop.guard import GuardLimits
from experiments.settings.load import load_settings
from experiments.settings.rig import LimitSection

OF_THE_ARM = {"q_lower", "q_upper"}


def test_every_limit_of_the_guard_without_a_default_is_set_by_rig_toml():
    required = {f.name for f in fields(GuardLimits) if f.default is MISSING}
    assert required - OF_THE_ARM == set(load_settings(None).rig.limits.of_guard())


def test_only_the_limits_of_tare_and_disk_are_not_the_guards():
    others = set(LimitSection.model_fields) - {f.name for f in fields(GuardLimits)}
    assert others == {"tare_spread", "residual", "free_disk_gb"}


LATER = (
    "ft_saturated_ms",
    "contact_force",
    "contact_force_hold",
    "contact_moment",
    "contact_moment_hold",
    "contact_growth",
)


def test_a_rig_toml_of_an_earlier_version_has_the_limits_of_contact_by_default():
    shipped = load_settings(None).rig.limits
    earlier = {k: v for k, v in shipped.model_dump().items() if k not in LATER}
    assert LimitSection.model_validate(earlier) == shipped


@pytest.mark.parametrize("name", ["contact_force", "contact_moment"])
def test_a_trial_ends_at_no_higher_load_than_hold_begins(name):
    values = load_settings(None).rig.limits.model_dump()
    values[name] = values[f"{name}_hold"] + 1.0
    with pytest.raises(ValidationError, match="above that of hold"):
        LimitSection.model_validate(values)
