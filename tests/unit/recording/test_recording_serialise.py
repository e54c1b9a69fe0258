from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.messages.decision import Decision, Mode, Switch, TransitionProbabilities
from companion.messages.motion import Setpoint
from companion.messages.ownship import LandedState
from companion.messages.perception import PadObservation, PoseHypothesis, TagDetection
from companion.recording.schemas import channel_schema
from companion.recording.serialise import encode_json, to_plain, to_record


def test_a_nested_message_becomes_plain_values() -> None:
    switch = Switch(t=2.0, mode=Mode.ALIGN, reason="near")
    numbers = TransitionProbabilities(a11=0.1, a22=0.2, a32=0.3, steady_align=0.4)
    record = to_record(Decision(t=2.0, mode=Mode.ALIGN, switched=switch, probabilities=numbers))
    assert record == {
        "t": 2.0,
        "mode": "align",
        "switched": {"t": 2.0, "mode": "align", "reason": "near"},
        "probabilities": {"a11": 0.1, "a22": 0.2, "a32": 0.3, "steady_align": 0.4},
    }


def test_tuples_of_messages_with_arrays_become_lists() -> None:
    seen = PadObservation(
        t=1.0,
        sequence=3,
        detections=(TagDetection(id=1, corners=np.ones((4, 2)), corner_sigma=0.1, method="x"),),
        hypotheses=(
            PoseHypothesis(rotation=np.eye(3), translation=np.ones(3), covariance=np.eye(6), reprojection_rms=0.1),
        ),
        search="frame",
    )
    record = json.loads(encode_json(to_record(seen)))
    assert record["detections"][0]["corners"] == [[1.0, 1.0]] * 4
    assert np.array(record["hypotheses"][0]["covariance"]).shape == (6, 6)


def test_numbers_survive_to_the_bit() -> None:
    values = np.random.default_rng(1).normal(size=50) * 10.0 ** np.arange(-25, 25)
    assert json.loads(encode_json({"v": values.tolist()}))["v"] == values.tolist()


@given(st.lists(st.floats(), max_size=5))
def test_what_json_cannot_hold_becomes_null(values: list[float]) -> None:
    read = json.loads(encode_json({"v": values}))["v"]
    assert read == [v if math.isfinite(v) else None for v in values]


def test_numpy_scalars_enums_and_arrays_in_a_hand_made_record_are_written() -> None:
    data = {"a": np.float64(1.5), "b": np.int64(3), "c": np.bool_(True), "d": LandedState.IN_AIR, "e": np.zeros(2)}
    assert json.loads(encode_json(data)) == {"a": 1.5, "b": 3, "c": True, "d": 2, "e": [0.0, 0.0]}


def test_what_has_no_plain_form_is_refused() -> None:
    with pytest.raises(TypeError, match="no plain form"):
        to_plain(object())
    with pytest.raises(TypeError, match="dataclass instance"):
        to_record({"a": 1})


def test_the_schema_knows_what_a_null_may_become() -> None:
    first = to_record(Decision(t=0.0, mode=Mode.SEARCH, switched=None, probabilities=None))
    properties = json.loads(channel_schema("decision", first))["properties"]
    assert properties["probabilities"]["properties"]["a22"] == {"type": "number"}
    assert properties["mode"] == {"type": "string"}


def test_the_schema_gives_matrices_their_depth() -> None:
    setpoint = Setpoint(
        t=0.0, position_ned=None, velocity_ned=np.zeros(3), acceleration_ned=np.zeros(3), yaw=0.0, yaw_rate=0.0
    )
    properties = json.loads(channel_schema("setpoint", to_record(setpoint)))["properties"]
    assert properties["velocity_ned"] == {"type": "array", "items": {"type": "number"}}
    assert properties["position_ned"]["type"] == "array"
    nested = json.loads(channel_schema("else", {"m": [[1.0]], "n": 1, "s": "x", "b": True, "empty": []}))["properties"]
    assert nested["m"]["items"] == {"type": "array", "items": {"type": "number"}}
    assert [nested[k]["type"] for k in ("n", "s", "b", "empty")] == ["integer", "string", "boolean", "array"]
