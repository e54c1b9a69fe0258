"""Recordings: MCAP files of everything a flight saw, thought and sent."""

from companion.recording.contents import RECORDING_NAME, SUMMARY_NAME, RawRecord, Record, Recording
from companion.recording.mcap_recorder import McapRecorder, RecorderState
from companion.recording.reader import read_recording
from companion.recording.recorder import MemoryRecorder, NullRecorder, Recorder
from companion.recording.serialise import encode_json, to_plain, to_record
from companion.recording.summary import write_json

__all__ = [
    "RECORDING_NAME",
    "SUMMARY_NAME",
    "McapRecorder",
    "MemoryRecorder",
    "NullRecorder",
    "RawRecord",
    "Record",
    "Recorder",
    "RecorderState",
    "Recording",
    "encode_json",
    "read_recording",
    "to_plain",
    "to_record",
    "write_json",
]
