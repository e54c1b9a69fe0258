"""Stick input: MANUAL_CONTROL and RC_CHANNELS_OVERRIDE, which source counts, moved sticks, switches and gestures.

Follows PX4 v1.17: manual_control/ManualControl.cpp, ManualControlSelector.cpp, MovingDiff.hpp, rc_update/rc_update.cpp.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from enum import IntEnum

from sitl_stub.vehicle.modes import MODE_SLOT_VALUES, Mode

FILTER_TIME = 0.1
"""Time constant [s] behind which the speed of a stick is judged."""
GESTURE_TIME = 1.0
"""So long [s] the sticks must stay in a corner to arm or disarm."""
SWITCH_REPEAT_TIME = 1.0
"""Two equal readings within this time [s] make a switch position count."""
MODE_SLOTS = 6
IGNORED_CHANNEL = 65535
TERMINATION_THRESHOLD = 0.75


@dataclass(frozen=True, slots=True, kw_only=True)
class Sticks:
    """Stick positions, -1 to 1: forward, right, up, yaw right."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    yaw: float = 0.0


CENTRED = Sticks()


class Source(IntEnum):
    """Where stick positions come from, in PX4's order of priority."""

    RADIO = 1
    MAVLINK_FIRST = 2
    MAVLINK_SECOND = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class PilotRequest:
    """What a pilot asks for by switch or gesture; each field None when untouched."""

    mode: Mode | None = None
    arm: bool | None = None
    kill: bool | None = None
    terminate: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Switches:
    mode_slot: int
    go_home: int
    hold: int
    offboard: int
    kill: int
    terminate: int
    arm: int


class _StickSpeed:
    """Low-passed speed of one stick [1/s]."""

    __slots__ = ("_last", "speed")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._last, self.speed = math.nan, 0.0

    def update(self, value: float, elapsed: float) -> float:
        if self._last == self._last:
            share = elapsed / (FILTER_TIME + elapsed)
            self.speed += ((value - self._last) / elapsed - self.speed) * share
        self._last = value
        return self.speed


class ManualControl:
    """Chooses among the sources (COM_RC_IN_MODE) and watches the sticks.

    `valid` is false COM_RC_LOSS_T after the last sample. The threshold COM_RC_STICK_OV [%] is on how *fast* a stick
    moves, throttle included: a jump counts, the same way taken slowly does not.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.sticks = CENTRED
        self.moving = False
        """Whether a stick moves fast enough to take over."""
        self.requests: list[PilotRequest] = []
        """What switches and gestures asked for since somebody looked."""
        self._source: Source | None = None
        self._first_source: Source | None = None
        self._time = -math.inf
        self._speeds = [_StickSpeed() for _ in range(4)]
        self._gesture_since: dict[str, float] = {}
        self._switches: _Switches | None = None
        self._switches_read: tuple[float, _Switches] | None = None

    @property
    def chooses_no_mode(self) -> bool:
        """Whether no mode switch belongs to the sticks: only a radio can have one (RC_MAP_FLTMODE)."""
        return self._source is not Source.RADIO or not int(self._parameters["RC_MAP_FLTMODE"])

    @property
    def arms_by_switch(self) -> bool:
        """Whether a switch arms (RC_MAP_ARM_SW), not a gesture."""
        return bool(int(self._parameters["RC_MAP_ARM_SW"]))

    def valid(self, t: float) -> bool:
        """Whether stick positions arrive at `t` [s]."""
        return t - self._time < self._parameters["COM_RC_LOSS_T"]

    def arrived(self, t: float, sticks: Sticks, source: Source) -> None:
        """Take stick positions; those of a source that does not count are dropped."""
        alive = self.valid(t)
        if not self._accepts(source, alive):
            return
        if not alive:
            self._forget_motion()
        self._source = source
        if self._first_source is None:
            self._first_source = source
        elapsed = max(t - self._time, 1e-3) if alive else 0.2
        limit = 0.01 * self._parameters["COM_RC_STICK_OV"]
        speeds = [speed.update(value, elapsed) for speed, value in zip(self._speeds, astuple(sticks), strict=True)]
        self.moving = any(abs(speed) > limit for speed in speeds)
        self.sticks, self._time = sticks, t
        self._watch_gestures(t, sticks)

    def lost(self) -> None:
        """Forget positions and motion: the samples have stopped."""
        self.sticks, self.moving = CENTRED, False
        self._switches = self._switches_read = None
        self._forget_motion()

    def _forget_motion(self) -> None:
        for speed in self._speeds:
            speed.reset()
        self._gesture_since.clear()

    def _accepts(self, source: Source, alive: bool) -> bool:
        """COM_RC_IN_MODE."""
        setting, present = int(self._parameters["COM_RC_IN_MODE"]), self._source if alive else None
        radio = source is Source.RADIO
        same = present is None or source is present
        rules = {
            0: radio,
            1: not radio and same,
            2: same,
            3: self._first_source is None or source is self._first_source,
            5: present is None or source <= present,
            6: present is None
            or (radio and present is Source.RADIO)
            or (not radio and (present is Source.RADIO or source <= present)),
            7: present is None or radio or (present is not Source.RADIO and source >= present),
            8: present is None or source >= present,
        }
        return rules.get(setting, False)

    # gestures and switches

    def _watch_gestures(self, t: float, sticks: Sticks) -> None:
        if not int(self._parameters["MAN_ARM_GESTURE"]):
            return
        centred = abs(sticks.forward) < 0.1 and abs(sticks.right) < 0.1
        low = centred and sticks.up < -0.8
        for name, corner, arm in (("arm", sticks.yaw > 0.9, True), ("disarm", sticks.yaw < -0.9, False)):
            if not (low and corner):
                self._gesture_since.pop(name, None)
                continue
            since = self._gesture_since.setdefault(name, t)
            if t - since >= GESTURE_TIME:
                self._gesture_since[name] = math.inf
                self.requests.append(PilotRequest(arm=arm))

    def channels_arrived(self, t: float, raw: Sequence[int]) -> None:
        """Take RC channels [us] of RC_CHANNELS_OVERRIDE. They count once the four sticks are mapped (RC_MAP_...)."""
        parameters = self._parameters
        count = next((i + 1 for i in reversed(range(len(raw))) if raw[i] not in (0, IGNORED_CHANNEL)), 0)
        count = min(count, len(raw))
        values = [self._scaled(i, raw[i]) for i in range(count)]
        names = ("RC_MAP_PITCH", "RC_MAP_ROLL", "RC_MAP_THROTTLE", "RC_MAP_YAW")
        mapped = [int(parameters[name]) for name in names]
        if not int(parameters["RC_CHAN_CNT"]) or not all(0 < channel <= count for channel in mapped):
            return
        forward, right, up, yaw = (values[channel - 1] for channel in mapped)
        self.arrived(t, Sticks(forward=forward, right=right, up=up, yaw=yaw), Source.RADIO)
        if self._source is Source.RADIO:
            self._read_switches(t, values)

    def _scaled(self, index: int, raw: int) -> float:
        """Channel [us] to -1 to 1 by RCn_MIN, TRIM, MAX and REV."""
        parameters, name = self._parameters, f"RC{index + 1}"
        low, trim, high = (parameters[f"{name}_{end}"] for end in ("MIN", "TRIM", "MAX"))
        if trim <= low or trim >= high:
            trim = 0.5 * (low + high)
        value = max(low, min(high, float(raw)))
        scaled = (value - trim) / (high - trim) if value > trim else (value - trim) / (trim - low)
        return -scaled if parameters[f"{name}_REV"] < 0.0 else scaled

    def _read_switches(self, t: float, values: Sequence[float]) -> None:
        read = _Switches(
            mode_slot=self._mode_slot(values),
            go_home=self._switch(values, "RC_MAP_RETURN_SW", self._parameters["RC_RETURN_TH"]),
            hold=self._switch(values, "RC_MAP_LOITER_SW", self._parameters["RC_LOITER_TH"]),
            offboard=self._switch(values, "RC_MAP_OFFB_SW", self._parameters["RC_OFFB_TH"]),
            kill=self._switch(values, "RC_MAP_KILL_SW", self._parameters["RC_KILLSWITCH_TH"]),
            terminate=self._switch(values, "RC_MAP_TERM_SW", TERMINATION_THRESHOLD),
            arm=self._switch(values, "RC_MAP_ARM_SW", self._parameters["RC_ARMSWITCH_TH"]),
        )
        previous, self._switches_read = self._switches_read, (t, read)
        if previous is None or previous[1] != read or t - previous[0] > SWITCH_REPEAT_TIME:
            return
        known, self._switches = self._switches, read
        if known is None:
            self.requests.append(PilotRequest(mode=self._slot_mode(read.mode_slot)))
        else:
            self._act_on_switches(known, read)

    def _mode_slot(self, values: Sequence[float]) -> int:
        """Slot 1 to 6 of the mode channel (RC_MAP_FLTMODE); 0: none."""
        channel = int(self._parameters["RC_MAP_FLTMODE"])
        if not 0 < channel <= len(values):
            return 0
        half, low, high = 1.0 / MODE_SLOTS, -1.05, 1.05
        return min(MODE_SLOTS, int(((values[channel - 1] - low) * MODE_SLOTS + half) / (high - low) + half) + 1)

    def _switch(self, values: Sequence[float], name: str, threshold: float) -> int:
        """Position of a switch: 1 on, -1 off, 0 not mapped."""
        channel = int(self._parameters[name])
        if not 0 < channel <= len(values):
            return 0
        value = 0.5 * values[channel - 1] + 0.5
        return 1 if (-value if threshold < 0.0 else value) > threshold else -1

    def _slot_mode(self, slot: int) -> Mode | None:
        return MODE_SLOT_VALUES.get(int(self._parameters[f"COM_FLTMODE{slot}"])) if slot else None

    def _act_on_switches(self, old: _Switches, new: _Switches) -> None:
        slot_mode = self._slot_mode(new.mode_slot)
        if new.mode_slot != old.mode_slot:
            self.requests.append(PilotRequest(mode=slot_mode))
        for before, now, mode in (
            (old.go_home, new.go_home, Mode.AUTO_RTL),
            (old.hold, new.hold, Mode.AUTO_LOITER),
            (old.offboard, new.offboard, Mode.OFFBOARD),
        ):
            if now != before:
                self.requests.append(PilotRequest(mode=mode if now > 0 else slot_mode))
        if new.arm != old.arm and new.arm:
            self.requests.append(PilotRequest(arm=new.arm > 0))
        if new.kill != old.kill and new.kill:
            self.requests.append(PilotRequest(kill=new.kill > 0))
        if new.terminate != old.terminate and new.terminate > 0:
            self.requests.append(PilotRequest(terminate=True))
