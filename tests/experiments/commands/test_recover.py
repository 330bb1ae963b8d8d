import json

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from acquisition.recording.recorder import seal
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover_file
from tests.acquisition.trials import (
    make_cycles,
    make_header,
    span_of,
    spans,
    summary_start,
    write_trial,
)
from tests.experiments.program import traction

CHUNK, ATTACHMENT = 6, 9


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """The bytes of a `.partial` of 300 cycles in six chunks."""
    path = tmp_path_factory.mktemp("left") / "T01.mcap"
    writer = write_trial(path, make_cycles(300), block=50)
    writer.close_partial()
    return writer.partial.read_bytes()


@pytest.fixture
def folder(tmp_path, left):
    """A session folder with a torn, an empty and a whole file."""
    trials = tmp_path / "S012" / "trials"
    trials.mkdir(parents=True)
    (trials / "T07.mcap.partial").write_bytes(left[:-3000])
    (trials / "T08.mcap.partial").write_bytes(left[:300])
    writer = write_trial(trials / "T06.mcap", make_cycles(100))
    seal(writer, "travel")
    return tmp_path / "S012"


def test_recover_reports_what_was_saved_and_lost(folder):
    done = traction("recover", folder / "trials" / "T07.mcap.partial")
    assert done.code == 0
    assert "saved 0.50 s, 250 cycles, 351 messages -> T07.recovered.mcap" in done.out
    assert "bytes; 0.10 s of the recording (0.10 s at 0.50 s). The source is" in (
        done.out
    )
    reader = TrialReader(folder / "trials" / "T07.recovered.mcap")
    assert not reader.is_complete


def test_recover_of_a_folder_recovers_its_partial_files(folder):
    done = traction("recover", folder)
    assert (folder / "trials" / "T07.recovered.mcap").exists()
    assert "T06" not in done.out
    assert "2 files: 1 done, 1 not." in done.out


def test_a_file_with_nothing_to_save_is_reported_and_others_are_recovered(folder):
    done = traction("recover", *sorted((folder / "trials").glob("*.partial"))[::-1])
    assert done.code == 6
    assert "T08.mcap.partial: has nothing to save" in done.err
    assert "The file is untouched." in done.err
    assert (folder / "trials" / "T07.recovered.mcap").exists()


def test_a_pattern_in_quotes_is_expanded(folder):
    done = traction("recover", folder / "trials" / "T07*.partial")
    assert done.code == 0
    assert (folder / "trials" / "T07.recovered.mcap").exists()


def test_a_file_named_twice_is_recovered_once(folder):
    path = folder / "trials" / "T07.mcap.partial"
    assert traction("recover", path, path).out.count("saved") == 1


def test_a_complete_trial_needs_no_recovery(folder):
    done = traction("recover", folder / "trials" / "T06.mcap")
    assert done.code == 0
    assert "is complete, nothing to recover (0.20 s, 100 cycles" in done.out


def test_a_second_recovery_reports_that_the_file_was_recovered_before(folder):
    path = folder / "trials" / "T07.mcap.partial"
    traction("recover", path)
    done = traction("recover", path)
    assert done.code == 0
    assert "was recovered before, 0.50 s, 250 cycles" in done.out


def test_a_recovered_trial_needs_no_recovery(folder):
    traction("recover", folder / "trials" / "T07.mcap.partial")
    done = traction("recover", folder / "trials" / "T07.recovered.mcap")
    assert done.code == 0
    assert "is sound, though incomplete, nothing to recover" in done.out


def test_a_missing_file_is_a_usage_error_before_any_work(folder):
    done = traction("recover", folder, folder / "T99.mcap.partial")
    assert done.code == 2
    assert "There is no file" in done.err
    assert not (folder / "trials" / "T07.recovered.mcap").exists()


def test_a_folder_without_partial_files_has_nothing_to_recover(tmp_path):
    done = traction("recover", tmp_path)
    assert done.code == 0
    assert "nothing to recover" in done.out


def test_a_half_copied_trial_is_compared_with_its_sidecar(tmp_path):
    path = tmp_path / "T01.mcap"
    seal(write_trial(path, make_cycles(300), block=50), "travel")
    path.with_suffix(".json").write_text('{"trial": "T01", "cycles": 300}')
    data = path.read_bytes()
    path.chmod(0o644)
    path.write_bytes(data[: len(data) // 2])
    done = traction("recover", path)
    cycles = TrialReader(tmp_path / "T01.recovered.mcap").cycles().data.size
    assert f"states 300 cycles: at least {300 - cycles} are missing" in done.out


@pytest.mark.parametrize("stated", ['"300"', "1e400", "true", "-1", "9" * 50])
def test_an_invalid_cycle_count_in_a_sidecar_reports_no_loss(folder, stated):
    sidecar = folder / "trials" / "T07.json"
    sidecar.write_text(f'{{"cycles": {stated}}}')
    done = traction("recover", folder / "trials" / "T07.mcap.partial")
    assert done.code == 0
    assert "are missing" not in done.out


def test_a_trial_without_a_data_checksum_is_copied_in_full(folder):
    source = folder / "trials" / "T06.mcap"
    data = bytearray(source.read_bytes())
    start = summary_start(data)
    data[start - 4 : start] = bytes(4)  # no checksum of the data
    other = folder / "trials" / "T09.mcap"
    other.write_bytes(data)
    done = traction("recover", other)
    assert done.code == 0
    assert "It has data without a checksum" in done.out
    copied = TrialReader(folder / "trials" / "T09.recovered.mcap").cycles()
    assert copied.data.tobytes() == TrialReader(source).cycles().data.tobytes()


def test_a_loss_in_the_middle_is_reported_with_its_time(folder):
    path = folder / "trials" / "T09.mcap"
    seal(write_trial(path, make_cycles(300), block=50), "travel")
    data = bytearray(path.read_bytes())
    third = [span for span in spans(bytes(data)) if span.opcode == CHUNK][2]
    data[third.body + 90] ^= 1
    path.chmod(0o644)
    path.write_bytes(bytes(data))
    done = traction("recover", path, "--json")
    (result,) = json.loads(done.out)
    assert result["cycles"] == 250
    assert result["gaps"] == [{"start": 0.2, "seconds": 0.1}]
    again = traction("recover", path)
    assert "0.10 s of the recording (0.10 s at 0.20 s)" in again.out


def with_damaged_attachment(folder, name):
    """A trial with a damaged attachment `name` that no other file holds."""
    path = folder / "trials" / "T09.mcap"
    header = make_header(attachments={name: b"# no other file has it"})
    seal(write_trial(path, make_cycles(300), header), "travel")
    data = bytearray(path.read_bytes())
    data[span_of(bytes(data), ATTACHMENT).end - 6] ^= 1
    path.chmod(0o644)
    path.write_bytes(bytes(data))
    return path


def test_a_lost_attachment_is_reported(folder):
    path = with_damaged_attachment(folder, "config.toml")
    done = traction("recover", path)
    assert "Lost: config.toml, which no file beside it holds." in done.out
    assert json.loads(traction("recover", path, "--json").out)[0][
        "attachments_missing"
    ] == ["config.toml"]


def test_a_copy_that_cannot_be_analysed_is_not_called_saved(folder):
    path = with_damaged_attachment(folder, "ft_calibration.toml")
    done = traction("recover", path)
    assert done.code == 6
    assert "saved" not in done.out
    assert "it cannot be analysed: it lacks ft_cal" in done.err
    (again,) = json.loads(traction("recover", path, "--json").out)
    assert (again["state"], again["obstacle"]) == ("copied", "ft_calibration.toml")
    copy = path.with_name("T09.recovered.mcap")
    done = traction("recover", copy)
    assert (done.code, done.out) == (6, "")
    assert "incomplete (0.60 s, 300 cycles" in done.err
    assert "it cannot be analysed: it lacks ft_calibration.toml" in done.err
    (itself,) = json.loads(traction("recover", copy, "--json").out)
    assert (itself["state"], itself["obstacle"]) == ("copied", "ft_calibration.toml")


def rewritten(source, target, *, has_checksums):
    """Rewrite the messages and metadata of a file, as another program does."""
    with source.open("rb") as file, target.open("wb") as out:
        reader = make_reader(file)
        writer = Writer(out, enable_data_crcs=has_checksums)
        writer.start(profile="ros2", library="another")
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        channels = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in channels:
                number = writer.register_schema(
                    schema.name, schema.encoding, schema.data
                )
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, number
                )
            writer.add_message(
                channels[channel.id],
                message.log_time,
                message.data,
                message.publish_time,
                message.sequence,
            )
        writer.finish()


@pytest.mark.parametrize("has_checksums", [False, True])
@pytest.mark.parametrize("is_complete", [False, True])
def test_a_file_rewritten_without_its_attachments_is_not_called_saved(
    folder, tmp_path, is_complete, has_checksums
):
    header = make_header(attachments={"terrain.toml": b"# no other file has it"})
    whole = tmp_path / "T10.mcap"
    writer = write_trial(whole, make_cycles(300), header)
    if is_complete:
        seal(writer, "travel")
    else:
        writer.close_partial()
        recover_file(writer.partial).path.rename(whole)
    path = folder / "trials" / "T10.mcap"
    rewritten(whole, path, has_checksums=has_checksums)
    done = traction("recover", path)
    assert done.code == 6
    assert "saved" not in done.out
    assert "it cannot be analysed: it lacks terrain.toml" in done.err
    (again,) = json.loads(traction("recover", path, "--json").out)
    assert (again["state"], again["obstacle"]) == ("copied", "terrain.toml")
    assert again["attachments_missing"] == ["terrain.toml"]


def test_a_missing_attachment_that_the_analysis_does_not_need_is_reported(
    folder, tmp_path
):
    whole = tmp_path / "T10.mcap"
    header = make_header(attachments={"config.toml": b"# no other file has it"})
    writer = write_trial(whole, make_cycles(300), header)
    writer.close_partial()
    recover_file(writer.partial).path.rename(whole)
    path = folder / "trials" / "T10.mcap"
    rewritten(whole, path, has_checksums=True)
    done = traction("recover", path)
    assert (done.code, done.err) == (0, "")
    assert "nothing to recover" in done.out
    assert "It lacks config.toml." in done.out
