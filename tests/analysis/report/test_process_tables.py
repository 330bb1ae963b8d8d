"""Tables of the ground as a process."""

from dataclasses import replace
from math import exp

import pytest

from analysis.findings.findings import compute_results, plain_findings
from analysis.report.process_tables import contact_table
from tests.analysis.terrains.test_contact_law import law_of


def test_a_contact_law_stands_beside_constant_friction(small_study):
    results = replace(compute_results(small_study), laws={"S0": law_of()})
    table = contact_table(results)
    ((name, count, capacity, *_, friction),) = table.rows
    assert (name, count) == ("S0", "10, 200")
    assert capacity == "8.0 (8.0 to 8.0)"
    assert len(table.rows[0]) == len(table.header)
    assert 0.2 < float(friction) < 4.0
    stored = plain_findings(results)["contact"]["S0"]["numbers"]["level"]
    assert exp(stored[0]) == pytest.approx(8.0)
    assert contact_table(replace(results, laws={})).rows == []
