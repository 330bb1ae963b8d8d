"""The output of a session shows whether the machine stalled."""

import pytest

from tests.processes.watching import is_stalled

LOOP = " ✔ loop 1 s       456.2 Hz · p99.9 late 1.97 ms · missed {}/490"


@pytest.mark.parametrize(
    ("text", "stalled"),
    [
        (LOOP.format(262), True),
        (LOOP.format(25), True),
        (LOOP.format(24), False),
        (LOOP.format(0), False),
        ("Node 2 does not answer GET IPNM (86) within 50 ms.", True),
        ("12 late cycles in one second", True),
        ("Joint 7 would need 1.4 N m (limit 1.3).", False),
        ("", False),
    ],
)
def test_a_stalled_machine_is_distinguished_from_a_fault(text, stalled):
    assert is_stalled(text) is stalled
