"""Inputs that once caused a failure, or might, are read or refused quickly."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from experiments.settings.load import load_settings
from ft_sensor.calibration.files import (
    terrain_from_toml,
    terrain_metadata,
    terrain_to_toml,
)
from ft_sensor.payload import TerrainFrame
from tests.attacks.parameters import parameters
from tests.corpus.damaged import damage_attacks
from tests.corpus.one_input import read_input
from tests.corpus.readers import READERS
from tests.corpus.samples import samples

CORPUS = Path(__file__).parents[1] / "data" / "corpus"
ROOT = Path(__file__).parents[2]
SECONDS = 2.0  # of CPU
MEMORY = 200 * 2**20
FRAME = TerrainFrame(0.1, 0.2, (0.7, 0.1, 0.12), 0.45)

# Reads every file of the corpus with limited address space; prints a line per file.
READER = """
import json, resource, sys
from pathlib import Path
from tests.corpus.one_input import read_input
pages = int(Path("/proc/self/statm").read_text().split()[0])
limit = pages * resource.getpagesize() + int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
for path in sorted(Path(sys.argv[2]).iterdir()):
    verdict = read_input(path.name.split(".")[0], path.read_bytes())
    print(json.dumps([path.name, verdict.is_sound, verdict.seconds, verdict.error]))
"""


@pytest.mark.slow
def test_every_file_of_the_corpus_is_read_or_refused_quickly():
    done = subprocess.run(
        [sys.executable, "-c", READER, str(MEMORY), str(CORPUS)],
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(rows) == len(list(CORPUS.iterdir()))
    assert [row for row in rows if not row[1] or row[2] > SECONDS] == []


def test_every_file_of_the_corpus_has_a_reader():
    names = {path.name.split(".")[0] for path in CORPUS.iterdir()}
    assert names <= set(READERS)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_a_valid_input_is_read(name):
    verdict = read_input(name, samples()[name])
    assert (verdict.error, verdict.strays) == ("", ())


@pytest.mark.parametrize("row", parameters(damage_attacks()))
def test_a_damaged_input_is_read_or_refused(row, tmp_path):
    row.check(tmp_path)


def test_a_terrain_file_needs_finite_numbers():
    text = terrain_to_toml("S10", FRAME, {}).replace("0.45", "nan")
    with pytest.raises(SettingsError, match="finite"):
        terrain_from_toml(text)


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=40))
def test_a_terrain_description_round_trips(text):
    written = terrain_to_toml("S10", FRAME, {"remark": text})
    assert terrain_metadata(written) == {"remark": text}


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/full"])
def test_settings_are_not_read_from_a_device(path):
    with pytest.raises(SettingsError, match="cannot be read"):
        load_settings(Path(path))


def test_oversized_settings_are_not_read(tmp_path):
    config = tmp_path / "rig.toml"
    config.write_text("#" * 2_000_000)
    with pytest.raises(SettingsError, match="cannot be read"):
        load_settings(config)
