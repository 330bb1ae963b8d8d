"""The laboratory's terrain database is one of today, and of the rig that it meets."""

import json

from analysis.foresight.model import RigIdentity
from experiments.rig.foresight_source import read_foresight
from lab.guest.scenarios.foresight import DATABASE
from tests.analysis.foresight.databases import laboratory_database
from tests.analysis.foresight.made import OTHER_RIG, RIG


def test_it_is_read_and_knows_both_rigs():
    source = read_foresight(DATABASE)
    assert source.model.knows(RIG)
    assert source.model.knows(OTHER_RIG)
    assert not source.model.knows(RigIdentity("false", "false", "0.3", "0.45"))


def test_it_is_of_the_form_that_is_written_today():
    def form(value):
        if isinstance(value, dict):
            return {key: form(inner) for key, inner in value.items()}
        return len(value) if isinstance(value, list) else type(value)

    kept, made = json.loads(DATABASE.read_text()), json.loads(laboratory_database())
    assert form(kept) == form(made)
