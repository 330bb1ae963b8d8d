"""`traction check --json` prints the page of the preflight for programs."""

import json

import pytest

from tests.experiments.program import traction, write_config

FAKE = ("check", "--fake", "--fast", "--loop-test", "0.3", "--json")


def test_the_page_of_a_fit_rig_is_json_and_nothing_else(tmp_path):
    done = traction(*FAKE, "--data", tmp_path)
    page = json.loads(done.out)
    assert (done.code, done.err) == (0, "")
    assert (page["schema"], page["is_fit"], page["is_simulated"]) == (1, True, True)
    assert page["problem"] is None
    names = [check["name"] for check in page["checks"]]
    assert {"pucks 1-7", "safety", "F/T sensor"} <= set(names)
    assert {check["grade"] for check in page["checks"]} <= {"good", "warning"}
    assert page["software"]["commit"]


@pytest.mark.slow
def test_the_page_of_a_refused_rig_is_json_with_its_failed_checks(tmp_path):
    change = ('"socketcan"', '"no-such-adapter"')
    config = write_config(tmp_path, rig=change)
    done = traction("check", "--json", "--config", config, "--data", tmp_path)
    page = json.loads(done.out)
    assert done.code == 3
    assert page["problem"] in done.err
    assert (page["is_fit"], page["is_simulated"]) == (False, False)
    bad = {check["name"] for check in page["checks"] if check["grade"] == "bad"}
    assert bad >= {"F/T sensor"}


@pytest.mark.parametrize(
    "other", [("--explain", "all"), ("--config-only",), ("--bus", "1")]
)
def test_json_is_refused_with_options_that_print_no_page(tmp_path, other):
    done = traction("check", "--json", *other, "--data", tmp_path)
    assert (done.code, done.out) == (2, "")
    assert "--json" in done.err
