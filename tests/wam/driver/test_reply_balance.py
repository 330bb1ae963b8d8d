"""A second sender is detected; late and lost replies are not taken for one."""

import pytest

from wam.driver.reply_balance import ReplyBalance


def ask(balance, replies, cycles=1):
    """Note `cycles` requests; motor 1 replies `replies` times, all others once."""
    for _ in range(cycles):
        balance.note_question()
        for i in range(7):
            balance.replies[i] += replies if i == 0 else 1


@pytest.mark.parametrize("behind", [0, 1, 24])
def test_delayed_replies_in_a_burst_are_not_a_second_sender(behind):
    balance = ReplyBalance()
    ask(balance, 0, cycles=behind)
    balance.replies[0] += behind
    ask(balance, 1, cycles=100)
    assert balance.doubled() == 0


def test_occasional_repeated_frames_are_not_a_second_sender():
    balance = ReplyBalance()
    for _ in range(100):
        ask(balance, 2)
        ask(balance, 1, cycles=59)
        assert balance.doubled() == 0


def test_a_second_sender_is_detected_despite_lost_replies():
    balance = ReplyBalance()
    ask(balance, 0, cycles=5000)
    ask(balance, 2, cycles=40)
    assert balance.doubled() == 1
