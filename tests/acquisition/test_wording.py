import pytest

from acquisition.wording import counted


@pytest.mark.parametrize(
    ("number", "text"), [(0, "0 trials"), (1, "1 trial"), (2, "2 trials")]
)
def test_the_noun_follows_its_number(number, text):
    assert counted(number, "trial") == text
