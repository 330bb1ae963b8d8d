from itertools import count

from benchmarks import lockstep


class Driver:
    def ask(self, device):
        return device.answer()


class Device:
    def answer(self):
        return "here"


def test_the_time_of_a_nested_call_counts_for_its_own_part(monkeypatch):
    calls = {"driver": ((Driver, "ask"),), "device": ((Device, "answer"),)}
    monkeypatch.setattr(lockstep, "PARTS", calls)
    parts = lockstep.PartClock(count().__next__)  # every reading takes a nanosecond
    with parts.watching():
        answers = {Driver().ask(Device()) for _ in range(2)}
        Device().answer()
    Device().answer()  # not watched any more
    assert answers == {"here"}
    # Two turns: the driver before and after the device. The rest is the loop's.
    assert parts.spent_ns == {"driver": 4, "device": 3, lockstep.LOOP: 3}
    assert parts.shares() == {"driver": 4 / 11, "device": 3 / 11, lockstep.LOOP: 4 / 11}
