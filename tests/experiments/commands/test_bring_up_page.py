"""The pages on bring-up and on a served arm quote the program exactly."""

import re
import shlex
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import PreflightError
from experiments.__main__ import COMMANDS, build_parser
from experiments.messages import CATALOGUE
from experiments.settings.load import load_settings
from fakes.pucks.options import NetworkOptions
from tests.experiments.commands.test_check_bus import listen
from tests.experiments.program import traction
from tests.fakes.stepped import Rig
from wam.bus.decoder import BusReader
from wam.bus.log import parse_log
from wam.bus.socketcan import setup_command
from wam.driver.arm import WamArm
from wam.driver.transmission import Transmission
from wam.model.constants import load_constants

ROOT = Path(__file__).parents[3]
PAGES = {
    name: (ROOT / "docs" / name).read_text()
    for name in ("bring-up.md", "served-arm.md")
}
PAGE = PAGES["bring-up.md"]
CONSTANTS = load_constants()


def blocks(page):
    return re.findall(r"```\w*\n(.*?)```", page, re.DOTALL)


def commands(page, program):
    """Command lines of a program on a page, without its output."""
    lines = [line for block in blocks(page) for line in block.splitlines()]
    return [
        line for line in lines if line.startswith(f"{program} ") and "  " not in line
    ]


def rows(page):
    """Cells of every row of every table."""
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def frames():
    """(frame, text) of every row that shows a frame, in order."""
    for cells in rows(PAGE):
        for frame, text in pairwise(cells):
            if re.fullmatch(r"`[0-9A-F]+#[0-9A-F]*`", frame):
                yield frame.strip("`"), text


def test_every_frame_decodes_to_its_text():
    reader = BusReader()
    raw = []
    for number, (frame, _) in enumerate(frames()):
        (logged,) = parse_log([f"({1e-4 * number:.6f}) can0 {frame}"], print)
        raw.append(reader.read(logged)[-1].text)
    texts = [re.sub(r", (LATE: )?\d+ us after the request$", "", text) for text in raw]
    assert texts == [text for _, text in frames()]
    assert len(texts) > 30


@pytest.mark.parametrize("page", PAGES)
def test_every_command_of_a_page_is_understood(page):
    lines = commands(PAGES[page], "traction")
    assert lines
    for line in lines:
        arguments = shlex.split(line.removesuffix("&"))[1:]
        assert build_parser().parse_args(arguments).command == arguments[0]


@pytest.mark.parametrize("page", PAGES)
def test_every_command_in_a_sentence_exists(page):
    assert set(re.findall(r"`traction (\w+)", PAGES[page])) <= set(COMMANDS)


def test_the_service_unit_starts_an_existing_command():
    (start,) = re.findall(r"^ExecStart=(.*)$", PAGES["served-arm.md"], re.MULTILINE)
    program, *arguments = shlex.split(start)
    assert program.endswith("/bin/traction")
    args = build_parser().parse_args(arguments)
    assert (args.command, args.bare, args.idle_first) == ("fake", True, True)


def test_every_option_on_the_page_of_a_served_arm_exists(capsys):
    with pytest.raises(SystemExit):
        build_parser().parse_args(["fake", "--help"])
    known = set(re.findall(r"--[a-z-]+", capsys.readouterr().out))
    assert set(re.findall(r"`(--[a-z-]+)", PAGES["served-arm.md"])) <= known


def test_the_command_that_sets_up_an_interface_is_the_same_everywhere():
    can = load_settings(None).rig.can
    setup = setup_command(can.channel, can.bitrate)
    assert setup in commands(PAGE, "ip")
    do = CATALOGUE["can-down"].do
    assert setup in do.format(channel=can.channel, bitrate=can.bitrate)
    for page in (ROOT / "docs").glob("*.md"):
        texts = re.findall(
            r"ip link set \S+ up [^\n`|]*type can[^\n`|]*", page.read_text()
        )
        assert {text.strip() for text in texts} <= {setup}, page.name


def refusal(options=None, silent=()):
    """Message with which start-up refuses an arm."""
    rig = Rig(options)
    for node in silent:
        rig.network.silence(node)
    with pytest.raises(PreflightError) as caught:
        WamArm(rig.link, rig.clock).start()
    return caught.value.message


REFUSALS = {
    "E-stop": (NetworkOptions(safety_mode=SafetyMode.E_STOP), ()),
    "no node answers": (None, (*range(1, 8), 10)),
    "one puck silent": (None, (5,)),
    "wrist silent": (None, (5, 6, 7)),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_every_start_up_refusal_is_quoted(what):
    assert f"`{refusal(*REFUSALS[what])}`" in PAGE


def test_the_message_about_missing_acknowledgement_is_quoted():
    rig = Rig()
    rig.network.faults.stop_acknowledging()
    with pytest.raises(PreflightError) as caught:
        WamArm(rig.link, rig.clock).start()
    assert f"`{caught.value.message}`" in PAGE


def test_the_message_about_an_arm_that_is_not_zeroed_is_quoted():
    assert f"`{CATALOGUE['not-zeroed'].what}`" in PAGE


def test_the_output_for_a_silent_bus_is_on_the_page(tmp_path):
    (head, *lines) = listen(tmp_path).out.splitlines()
    assert head.endswith("nothing is sent")
    assert all(line in PAGE for line in lines)
    assert len(lines) == 3


def test_the_output_for_another_master_is_on_the_page(tmp_path):
    out = listen(tmp_path, 0x00A, 0x404).out
    (line,) = [line for line in out.splitlines() if "another program" in line]
    assert line in PAGE


def test_the_output_of_zeroing_is_on_the_page():
    done = traction("zero", "--fake", "--yes")
    lines = [line for line in done.out.splitlines() if "mech_at_home" not in line]
    assert len(lines) == 3
    assert all(line in PAGE for line in lines)


def test_the_puck_positions_of_a_turned_joint_are_those_of_the_page():
    transmission = Transmission(CONSTANTS.j2mp, CONSTANTS.cts, CONSTANTS.ipnm)
    shown = [cells for cells in rows(PAGE) if re.match(r"J\d", cells[0])]
    assert [cells[0][:2] for cells in shown] == [f"J{joint}" for joint in range(1, 8)]
    for joint, cells in enumerate(shown):
        q = np.zeros(7)
        q[joint] = 0.1
        counts = [round(count) for count in transmission.exact_counts(q).tolist()]
        assert [int(number) for number in cells[1].split()] == counts
