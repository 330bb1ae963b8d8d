"""`python -m lab` checks its arguments and names missing packages."""

import pytest

from lab import __main__ as program
from lab.follower import PANICKED
from lab.guest.scenarios.registry import ALL, Scenario
from lab.kernel import Kernel, image_package
from lab.machine import SLOWNESS, Sockets, command
from lab.requirements import LabError, install_line, missing_packages
from lab.results import ScenarioResult, Verdict


def test_missing_programs_are_reported_once_by_their_packages():
    absent = {"modprobe", "depmod", "qemu-system-x86_64"}
    packages = missing_packages(lambda name: None if name in absent else f"/bin/{name}")
    assert packages == ["kmod", "qemu-system-x86"]


def test_no_package_is_missing_if_every_program_exists():
    assert missing_packages(lambda name: f"/bin/{name}") == []


def test_the_install_command_includes_the_firmware():
    assert install_line(["kmod"]).split()[-2:] == ["kmod", "seabios"]


def test_a_run_with_missing_packages_prints_the_install_command(monkeypatch, capsys):
    monkeypatch.setattr(program, "missing_packages", lambda: ["kmod"])
    assert program.main([]) == program.NOT_READY
    assert install_line(["kmod"]) in capsys.readouterr().out


def test_an_unknown_scenario_is_refused_with_a_list_of_scenarios(capsys):
    assert program.main(["--only", "nonsense"]) == 2
    out = capsys.readouterr().out
    assert all(scenario.name in out for scenario in ALL)


def test_scenarios_are_listed_although_packages_are_missing(monkeypatch, capsys):
    monkeypatch.setattr(program, "missing_packages", lambda: ["kmod"])
    assert program.main(["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(ALL)


def test_every_scenario_has_a_unique_name_and_a_sentence():
    assert len({scenario.name for scenario in ALL}) == len(ALL)
    assert all(scenario.what.endswith(".") for scenario in ALL)


def test_the_kernel_package_is_the_one_debian_depends_on():
    text = "linux-image-amd64\n  Depends: linux-image-6.1.0-56-amd64\n"
    assert image_package(text) == "linux-image-6.1.0-56-amd64"


def test_a_system_without_debians_kernel_is_refused():
    with pytest.raises(LabError, match="linux-image-amd64"):
        image_package("")


def test_the_machine_has_read_only_files_and_two_cards_on_one_bus(
    monkeypatch, tmp_path
):
    monkeypatch.setattr("lab.machine.program", lambda name: f"/usr/bin/{name}")
    sockets = Sockets(*(tmp_path / name for name in "abcd"))
    kernel = Kernel(tmp_path / "vmlinux", ())
    words = command(kernel, tmp_path / "initramfs", sockets, 9)
    # killed together with the laboratory's own process
    assert words[:3] == ["/usr/bin/setpriv", "--pdeathsig", "KILL"]
    assert any("path=/," in word and "readonly=on" in word for word in words)
    cards = [word for word in words if word.startswith("kvaser_pci")]
    assert len(cards) == 2
    assert all("canbus=bus0" in card for card in cards)
    assert f"tsc_early_khz={SLOWNESS}000000" in words[words.index("-append") + 1]


def scenarios_of(*weights):
    return [
        Scenario(f"number {number}", lambda room: {}, weight=weight)
        for number, weight in enumerate(weights)
    ]


@pytest.mark.parametrize("count", [1, 2, 5, 8])
def test_machines_share_every_scenario_once_and_none_is_idle(count):
    scenarios = scenarios_of(1, 1, 1, 1, 1)
    parts = program.shares(scenarios, count)
    names = sorted(scenario.name for part in parts for scenario in part)
    assert names == sorted(scenario.name for scenario in scenarios)
    assert len(parts) == min(count, 5)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1
    assert all(parts)


def test_machines_take_equal_weights():
    parts = program.shares(scenarios_of(1, 7, 2, 4, 6), 2)
    assert sorted(sum(item.weight for item in part) for part in parts) == [10, 10]
    assert parts[0][0].weight == 7


class Boots:
    """A scripted `boot`: one list of (name, verdict, reason) for each start."""

    def __init__(self, *starts):
        self._starts = list(starts)
        self.asked = []

    def __call__(self, scenarios, cache, *, is_shown):
        self.asked.append([scenario.name for scenario in scenarios])
        return [
            ScenarioResult(name, verdict, 1.0, {}, reason)
            for name, verdict, reason in self._starts.pop(0)
        ]


def fine(name):
    return name, Verdict.PASSED, ""


def panicked(name):
    return name, Verdict.HUNG, PANICKED


def run(monkeypatch, boots, count=3):
    monkeypatch.setattr(program, "boot", boots)
    return program.run_machine(ALL[:count], program.CACHE, is_shown=False)


def test_a_panicked_machine_boots_again_for_the_remaining_scenarios(monkeypatch):
    first, second, third = (scenario.name for scenario in ALL[:3])
    boots = Boots([fine(first), panicked(second)], [fine(second), fine(third)])
    results = run(monkeypatch, boots)
    assert boots.asked == [[first, second, third], [second, third]]
    assert [result.name for result in results] == [first, second, third]
    assert [result.verdict for result in results] == [Verdict.PASSED] * 3
    assert [result.figures for result in results] == [{}, {"repeated": PANICKED}, {}]


def test_a_repeated_panic_is_a_failure(monkeypatch):
    first, second = (scenario.name for scenario in ALL[:2])
    boots = Boots([fine(first), panicked(second)], [panicked(second)])
    results = run(monkeypatch, boots)
    assert [result.verdict for result in results] == [Verdict.PASSED, Verdict.HUNG]


def test_a_machine_that_hung_without_a_panic_does_not_boot_again(monkeypatch):
    first, second, _ = (scenario.name for scenario in ALL[:3])
    boots = Boots([fine(first), (second, Verdict.HUNG, "the machine hung")])
    assert len(run(monkeypatch, boots)) == 2
    assert len(boots.asked) == 1


def test_a_boot_that_panics_is_repeated_once(monkeypatch):
    boots = Boots([panicked("boot")], [panicked("boot")])
    (lost,) = run(monkeypatch, boots)
    assert lost.verdict is Verdict.HUNG
    assert len(boots.asked) == 2
