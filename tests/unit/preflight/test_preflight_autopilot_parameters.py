"""Rule 4: what the autopilot's parameters must be; read, judged, named, and never changed."""

from __future__ import annotations

import math

import pytest

from companion.link import outgoing
from companion.preflight.autopilot_parameters import (
    ParameterGate,
    WantedBits,
    WantedChoice,
    WantedParameters,
    WantedRange,
    judge_parameters,
)
from companion.preflight.finding import Verdict

NAMES = tuple(WantedParameters().rules)
PX4_DEFAULTS = {
    "COM_RC_OVERRIDE": 1.0,
    "COM_OBL_RC_ACT": 0.0,
    "COM_OF_LOSS_T": 1.0,
    "COM_RCL_EXCEPT": 0.0,
    "NAV_RCL_ACT": 2.0,
    "GF_ACTION": 2.0,
}


def refused(values: dict[str, float | None]) -> set[str]:
    return {
        finding.check
        for finding in judge_parameters(WantedParameters().rules, values)
        if finding.verdict is not Verdict.FINE
    }


def test_the_rulebook_names_six() -> None:
    assert set(NAMES) == set(PX4_DEFAULTS)


def test_of_px4s_defaults_only_the_sticks_are_refused() -> None:
    assert refused(dict(PX4_DEFAULTS)) == {"COM_RC_OVERRIDE"}
    assert refused(PX4_DEFAULTS | {"COM_RC_OVERRIDE": 3.0}) == set()
    assert refused(PX4_DEFAULTS | {"COM_RC_OVERRIDE": 2.0}) == set()


@pytest.mark.parametrize(
    ("name", "safe", "unsafe"),
    [
        ("COM_RC_OVERRIDE", [2, 3], [0, 1]),
        ("COM_OBL_RC_ACT", [0, 3, 4, 5], [1, 2, 6, 7, -1]),
        ("COM_OF_LOSS_T", [0.3, 1.0, 2.0], [0.0, 0.29, 2.1, 60.0]),
        ("COM_RCL_EXCEPT", [0, 1, 3, 8], [4, 5, 7, 31]),
        ("NAV_RCL_ACT", [1, 2, 3], [0, 5, 6]),
        ("GF_ACTION", [2, 3, 5], [0, 1, 4]),
    ],
)
def test_which_values_will_do(name: str, safe: list[float], unsafe: list[float]) -> None:
    fine = PX4_DEFAULTS | {"COM_RC_OVERRIDE": 3.0}
    assert all(refused(fine | {name: float(value)}) == set() for value in safe)
    assert all(refused(fine | {name: float(value)}) == {name} for value in unsafe)


@pytest.mark.parametrize("value", [None, math.nan, math.inf])
def test_no_value_is_never_fine(value: float | None) -> None:
    assert refused(dict.fromkeys(NAMES, value)) == set(NAMES)


def test_whatever_the_configuration_accepts_is_accepted() -> None:
    anything = WantedParameters(
        COM_RC_OVERRIDE=WantedBits(bits_set=0, bits_clear=0),
        COM_OBL_RC_ACT=WantedChoice(values=()),
        COM_OF_LOSS_T=WantedRange(least=0.0, most=60.0),
        COM_RCL_EXCEPT=WantedBits(bits_set=0, bits_clear=0),
        NAV_RCL_ACT=WantedChoice(values=()),
        GF_ACTION=WantedChoice(values=()),
    )
    findings = judge_parameters(anything.rules, dict.fromkeys(NAMES, 7.0))
    assert all(finding.verdict is Verdict.FINE for finding in findings)


def test_a_refusal_has_name_value_and_wanted_value() -> None:
    gate = ParameterGate(WantedParameters().rules)
    assert not gate.complete
    for name, value in (PX4_DEFAULTS | {"GF_ACTION": 4.0}).items():
        gate.take(name, value)
    gate.take("SOMETHING_ELSE", 1.0)
    assert gate.complete
    sticks, fence = gate.objections()
    assert sticks.startswith("COM_RC_OVERRIDE is 1, wanted: bit 1 set")
    assert fence.startswith("GF_ACTION is 4 (Terminate), wanted: 2 or 3 or 5 (Hold, Return, Land)")
    gate.forget()
    assert not gate.complete
    assert len(gate.objections()) == 6


def test_no_parameter_can_be_set() -> None:
    names = {outgoing.mavlink.mavlink_map[number].msgname for number in outgoing.ALLOWED_MESSAGES}
    assert not any("PARAM" in name and "READ" not in name for name in names)
