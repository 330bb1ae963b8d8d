import pytest

from tests.architecture import measures


@pytest.mark.parametrize("measure", measures(), ids=lambda measure: measure.name)
def test_the_structure_stays_within_its_limits(measure):
    assert measure.is_met, "\n".join(measure.where)
