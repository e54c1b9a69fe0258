from __future__ import annotations

import math
import threading
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader, breakup_chunk

from companion.errors import RecordingError
from companion.recording import McapRecorder, MemoryRecorder, NullRecorder, Recorder, read_recording, write_json
from companion.recording import sink as sink_module

METADATA = {"run": {"seed": "7", "version": "0.1"}, "configuration": {"yaml": "a: 1\n"}}


def fill(recorder: Recorder, seconds: float = 3.0) -> None:
    for k in range(int(seconds * 50)):
        t = k / 50
        recorder.record("ownship", t, {"t": t, "position_ned": [math.sin(t), 0.1 * k, -t]})
        recorder.record_bytes("mavlink_in", t + 0.001, bytes([k % 256]) * 20)


def chunks(path: Path) -> list[Chunk]:
    with path.open("rb") as file:
        return [r for r in StreamReader(file, emit_chunks=True).records if isinstance(r, Chunk)]


def test_everything_comes_back(tmp_path: Path) -> None:
    recorder, memory = McapRecorder(tmp_path / "deep" / "a.mcap", METADATA), MemoryRecorder(METADATA)
    for each in (recorder, memory):
        fill(each)
        each.close()
    read = read_recording(tmp_path / "deep" / "a.mcap")
    kept = memory.recording()
    assert read.complete
    assert read.metadata == METADATA
    assert [r.data for r in read.of("ownship")] == [r.data for r in kept.of("ownship")]
    assert [r.t for r in read.of("ownship")] == pytest.approx([r.t for r in kept.of("ownship")], abs=1e-9)
    assert [r.data for r in read.raw["mavlink_in"]] == [r.data for r in kept.raw["mavlink_in"]]
    assert recorder.state.recorded == 300
    assert recorder.state.dropped == 0
    assert recorder.take_problem() is None


def test_equal_calls_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        recorder = McapRecorder(tmp_path / name, METADATA)
        fill(recorder)
        recorder.close()
    background = McapRecorder(tmp_path / "c", METADATA, background=True)
    fill(background)
    background.close()
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes() == (tmp_path / "c").read_bytes()


def test_the_index_serves_readers_that_seek(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap")
    fill(recorder)
    recorder.close()
    with (tmp_path / "a.mcap").open("rb") as file:
        found = list(make_reader(file).iter_messages(topics=["ownship"], starting_at=1_000_000_000))
    assert len(found) == 100
    assert found[0][0].encoding == "jsonschema"


def test_the_summary_agrees_with_the_messages(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap", METADATA)
    fill(recorder)
    recorder.close()
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        names = {channel.id: channel.topic for channel in summary.channels.values()}
        counts = {names[k]: n for k, n in summary.statistics.channel_message_counts.items()}
        assert counts == {"ownship": 150, "mavlink_in": 150}
        assert summary.statistics.message_start_time == 0
        assert summary.statistics.message_end_time == 2_981_000_000
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) == len(chunks(tmp_path / "a.mcap"))
        assert {block.name: dict(block.metadata) for block in reader.iter_metadata()} == METADATA
        assert len(list(reader.iter_messages())) == 300
    with (tmp_path / "a.mcap").open("rb") as file:  # every CRC in the file
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 300


def test_chunks_are_small_and_short(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap")
    fill(recorder)
    for k in range(40):  # dense: the size decides
        recorder.record_bytes("picture", 3.0 + k * 1e-3, bytes(20_000))
    recorder.close()
    found = chunks(tmp_path / "a.mcap")
    assert len(found) > 12
    assert max(c.uncompressed_size for c in found) <= 64 * 1024
    assert max(c.message_end_time - c.message_start_time for c in found) < 500_000_000


def test_one_large_message_has_a_chunk_of_its_own(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap")
    recorder.record("a", 0.0, {"x": 1})
    recorder.record_bytes("picture", 0.01, bytes(300_000))
    recorder.record("a", 0.02, {"x": 2})
    recorder.close()
    messages = [sum(type(r).__name__ == "Message" for r in breakup_chunk(c)) for c in chunks(tmp_path / "a.mcap")]
    assert messages == [1, 1, 1]


def test_a_killed_program_loses_less_than_half_a_second(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap")
    fill(recorder)
    left = read_recording(tmp_path / "a.mcap")  # as a killed program leaves it: not closed
    recorder.close()
    assert not left.complete
    assert left.of("ownship")[-1].t >= 3.0 - 0.52


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(5, 4000), damage=st.integers(0, 255))
@example(cut=2192, damage=128)  # a length beyond what a file may be
def test_a_damaged_file_gives_what_precedes_the_damage(tmp_path: Path, cut: int, damage: int) -> None:
    path = tmp_path / "whole.mcap"
    if not path.exists():
        recorder = McapRecorder(path)
        fill(recorder)
        recorder.close()
    whole = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[:cut])
    (tmp_path / "hit.mcap").write_bytes(whole[:cut] + bytes([damage]) + whole[cut + 1 :])
    times = [r.t for r in read_recording(path).of("ownship")]
    assert [r.t for r in read_recording(tmp_path / "cut.mcap").of("ownship")] == times[: _count(tmp_path / "cut.mcap")]
    read_recording(tmp_path / "hit.mcap")


def _count(path: Path) -> int:
    return len(read_recording(path).of("ownship"))


def test_files_that_are_no_recordings_are_refused(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_text("hello")
    with pytest.raises(RecordingError, match="not an MCAP recording"):
        read_recording(tmp_path / "x.mcap")
    with pytest.raises(RecordingError, match=r"no such file; check the path; .* there are: x\.mcap"):
        read_recording(tmp_path / "missing.mcap")
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path)


def test_a_place_that_cannot_be_written_is_refused_before_the_flight(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be made"):
        McapRecorder(tmp_path / "file" / "a.mcap")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("background", [False, True])
def test_a_full_disk_stops_the_recording_and_not_the_flight(monkeypatch: pytest.MonkeyPatch, background: bool) -> None:
    monkeypatch.setattr(sink_module, "RESERVE_BYTES", 0)
    recorder = McapRecorder("/dev/full", background=background)
    fill(recorder, 30.0)
    recorder.close()
    fill(recorder, 0.1)
    problem = recorder.take_problem()
    assert problem is not None
    assert "No space left" in problem
    assert recorder.take_problem() is None
    assert recorder.state.dropped > 0


def test_the_recording_leaves_the_system_some_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sink_module, "RESERVE_BYTES", 2**62)
    recorder = McapRecorder(tmp_path / "a.mcap")
    fill(recorder, 1.0)
    recorder.close()
    assert recorder.state.recorded == 0
    assert "are kept for the system" in str(recorder.take_problem())


def test_a_message_that_cannot_be_written_is_lost_alone(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap")
    recorder.record("a", 1.0, {"x": object()})
    recorder.record("a", math.nan, {"x": 1})
    recorder.record("a", -1.0, {"x": 1})
    recorder.record("a", 1.0, {"x": 1})
    recorder.close()
    assert [r.data for r in read_recording(tmp_path / "a.mcap").of("a")] == [{"x": 1}]
    assert recorder.state.dropped == 3
    assert "no plain form" in str(recorder.take_problem())


def test_a_stalled_disk_drops_whole_messages_and_keeps_the_file_readable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = threading.Event()
    write = sink_module.FileSink.write

    def slow(self: sink_module.FileSink, data: bytes) -> int:
        gate.wait(10.0)
        return write(self, data)

    monkeypatch.setattr(sink_module.FileSink, "write", slow)
    recorder = McapRecorder(tmp_path / "a.mcap", background=True)
    fill(recorder, 60.0)
    assert recorder.state.dropped > 0
    gate.set()
    recorder.close()
    read = read_recording(tmp_path / "a.mcap")
    assert read.complete
    assert len(read.of("ownship")) + len(read.raw["mavlink_in"]) == recorder.state.recorded


def test_times_may_go_back(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap")
    for t in (5.0, 4.0, 4.9, 5.1):
        recorder.record("a", t, {"t": t})
    recorder.close()
    assert [r.t for r in read_recording(tmp_path / "a.mcap").of("a")] == [5.0, 4.0, 4.9, 5.1]


def test_nothing_is_taken_after_the_end() -> None:
    memory = MemoryRecorder()
    memory.close()
    fill(memory, 0.1)
    assert not memory.recording().messages
    assert memory.recording().last("ownship") is None
    silent = NullRecorder()
    fill(silent, 0.1)
    silent.close()


def test_the_summary_is_written_whole(tmp_path: Path) -> None:
    write_json(tmp_path / "new" / "summary.json", {"wall_s": 1.5, "list": (1, 2)})
    assert (
        tmp_path / "new" / "summary.json"
    ).read_text() == '{\n  "wall_s": 1.5,\n  "list": [\n    1,\n    2\n  ]\n}\n'
    with pytest.raises(RecordingError, match="cannot be written"):
        write_json(tmp_path / "new" / "summary.json" / "x.json", {})
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["summary.json"]
