"""MCAP files of other programs are refused with a list of their topics."""

import pytest
from mcap.writer import CompressionType, Writer

from acquisition.errors import TrialFileError
from acquisition.trial_file.foreign import foreign_reason
from acquisition.trial_file.reader import TrialReader
from tests.acquisition.trials import make_cycles, write_trial


def foreign(path, topics, *, profile="", crcs=True, compression=CompressionType.LZ4):
    """Write an MCAP file as other programs do."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, enable_crcs=crcs)
        writer.start(profile=profile, library="other")
        schema = writer.register_schema("Any", "jsonschema", b"{}")
        for topic in topics:
            channel = writer.register_channel(topic, "json", schema)
            writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    return path


@pytest.mark.parametrize("profile", ["", "ros2"])
@pytest.mark.parametrize("crcs", [True, False])
@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.NONE])
def test_the_contents_of_a_foreign_file_are_reported(
    tmp_path, profile, crcs, compression
):
    path = foreign(
        tmp_path / "log.mcap",
        ["/imu", "/tf"],
        profile=profile,
        crcs=crcs,
        compression=compression,
    )
    with pytest.raises(TrialFileError) as caught:
        TrialReader(path)
    assert caught.value.reason == "is no trial of Traction: it holds topics /imu, /tf"
    assert "traction fit" in caught.value.hint


def test_many_topics_are_counted(tmp_path):
    path = foreign(tmp_path / "log.mcap", [f"/t{i}" for i in range(9)])
    assert foreign_reason(path).endswith("/t0, /t1, /t2, /t3 and 5 more")


def test_a_damaged_trial_keeps_its_own_message(tmp_path):
    writer = write_trial(tmp_path / "T01.mcap", make_cycles(100))
    writer.close_partial()
    assert foreign_reason(writer.partial) == ""
    with pytest.raises(TrialFileError, match="cut off"):
        TrialReader(writer.partial)
    assert foreign_reason(tmp_path / "none") == ""
