"""Which failures there are and what PX4's parameters make of them (commander/failsafe/failsafe.cpp, v1.17)."""

from collections.abc import Mapping

from sitl_stub.vehicle.failsafe_actions import Action, Cause, Clear, FailsafeFlags, Response, Takeover
from sitl_stub.vehicle.modes import AUTO, Mode

DISABLE_MANUAL_CONTROL = 4
"""COM_RC_IN_MODE: no sticks at all."""
LINK_LOSS_ACTIONS = {
    1: Action.HOLD,
    2: Action.RETURN,
    3: Action.LAND,
    5: Action.TERMINATE,
    6: Action.DISARM,
}
"""NAV_RCL_ACT and NAV_DLL_ACT."""
GEOFENCE_ACTIONS = {
    0: Action.NONE,
    1: Action.WARN,
    2: Action.HOLD,
    3: Action.RETURN,
    4: Action.TERMINATE,
    5: Action.LAND,
}
"""GF_ACTION."""
OFFBOARD_LOSS_ACTIONS = {
    0: (Action.FALLBACK_POSITION, Mode.POSCTL),
    1: (Action.FALLBACK_ALTITUDE, Mode.ALTCTL),
    2: (Action.FALLBACK_STABILIZED, Mode.STABILIZED),
    3: (Action.RETURN, Mode.AUTO_RTL),
    4: (Action.LAND, Mode.AUTO_LAND),
    5: (Action.HOLD, Mode.AUTO_LOITER),
    6: (Action.TERMINATE, Mode.TERMINATION),
    7: (Action.DISARM, Mode.OFFBOARD),
}
"""COM_OBL_RC_ACT, and the mode whose needs are then looked at."""
_FALLBACKS = frozenset({Action.FALLBACK_POSITION, Action.FALLBACK_ALTITUDE, Action.FALLBACK_STABILIZED})
_BATTERY_CAUSES = {1: Cause.BATTERY_LOW, 2: Cause.BATTERY_CRITICAL, 3: Cause.BATTERY_EMERGENCY}
_BATTERY_NAMES = {1: "battery low", 2: "battery critical", 3: "battery emergency"}


class FailsafeConditions:
    """Remembers what was wrong already when the vehicle was armed: that alone starts no failsafe."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self._sticks_lost_at_arming = True
        self._battery_at_arming = 0
        self._armed = False

    def failures(self, flags: FailsafeFlags, *, armed: bool, intended: Mode) -> dict[str, Response]:
        """What each present failure asks for, by name."""
        if not armed or not self._armed:
            self._sticks_lost_at_arming = flags.manual_control_lost
            self._battery_at_arming = flags.battery_warning
        self._armed = armed
        if not flags.manual_control_lost:
            self._sticks_lost_at_arming = False
        parameters, found = self._parameters, {}
        ignored = self._sticks_lost_at_arming or _excepted(intended, int(parameters["COM_RCL_EXCEPT"]))
        enabled = int(parameters["COM_RC_IN_MODE"]) != DISABLE_MANUAL_CONTROL
        if flags.manual_control_lost and enabled and not ignored:
            found["manual control"] = _link_loss(int(parameters["NAV_RCL_ACT"]), Cause.MANUAL_CONTROL_LOSS)
        ignored = _excepted(intended, int(parameters["COM_DLL_EXCEPT"])) or intended in (
            Mode.AUTO_LAND,
            Mode.AUTO_PRECLAND,
        )
        if flags.ground_station_lost and int(parameters["NAV_DLL_ACT"]) and not ignored:
            found["ground station"] = _link_loss(int(parameters["NAV_DLL_ACT"]), Cause.GROUND_STATION_LOSS)
        if flags.geofence_breached:
            found["geofence"] = _geofence(int(parameters["GF_ACTION"]))
        if flags.battery_warning:
            found[_BATTERY_NAMES[flags.battery_warning]] = self._battery(flags.battery_warning)
        return found

    def _battery(self, warning: int) -> Response:
        """Low: a text. Critical and emergency: by COM_LOW_BAT_ACT, unless it was as low when the vehicle was armed."""
        setting = int(self._parameters["COM_LOW_BAT_ACT"]) if warning > self._battery_at_arming else 0
        action = Action.WARN
        if warning == 2:
            action = {2: Action.LAND, 1: Action.RETURN, 3: Action.RETURN}.get(setting, Action.WARN)
        elif warning == 3:
            action = {1: Action.RETURN, 2: Action.LAND, 3: Action.LAND}.get(setting, Action.WARN)
        return Response(action=action, cause=_BATTERY_CAUSES[warning])

    def fallback(self, flags: FailsafeFlags, mode: Mode) -> Action:
        """What is done when `mode` itself cannot run: a weaker mode that needs less, or Return."""
        action, parameters = Action.NONE, self._parameters
        if flags.offboard_signal_lost and mode is Mode.OFFBOARD:
            setting = int(parameters["COM_OBL_RC_ACT"])
            action, mode = OFFBOARD_LOSS_ACTIONS.get(setting, OFFBOARD_LOSS_ACTIONS[0])
            if action is Action.DISARM:
                return action
            if action in _FALLBACKS and flags.manual_control_lost:
                action = LINK_LOSS_ACTIONS.get(int(parameters["NAV_RCL_ACT"]), Action.NONE)
        if mode is Mode.POSCTL and not flags.can_run(mode):
            action, mode = Action.FALLBACK_ALTITUDE, Mode.ALTCTL
        if mode is Mode.ALTCTL and not flags.can_run(mode):
            action, mode = Action.FALLBACK_STABILIZED, Mode.STABILIZED
        return action if flags.can_run(mode) else Action.RETURN


def _excepted(mode: Mode, bits: int) -> bool:
    """COM_RCL_EXCEPT, COM_DLL_EXCEPT: bit 0 Mission, bit 1 the other AUTO modes, bit 2 OFFBOARD."""
    if mode is Mode.AUTO_MISSION:
        return bool(bits & 1)
    if mode in AUTO:
        return bool(bits & 2)
    return mode is Mode.OFFBOARD and bool(bits & 4)


def _link_loss(setting: int, cause: Cause) -> Response:
    action = LINK_LOSS_ACTIONS.get(setting, Action.NONE)
    if action is Action.TERMINATE:
        return Response(action=action, takeover=Takeover.NEVER, clear=Clear.NEVER, cause=cause)
    if action is Action.DISARM:
        return Response(action=action, takeover=Takeover.NEVER, cause=cause)
    clear = Clear.AT_ONCE if action is Action.NONE else Clear.ON_MODE_CHANGE_OR_DISARM
    return Response(action=action, clear=clear, cause=cause)


def _geofence(setting: int) -> Response:
    action = GEOFENCE_ACTIONS.get(setting, Action.WARN)
    if action is Action.TERMINATE:
        return Response(action=action, takeover=Takeover.NEVER, clear=Clear.NEVER)
    if action is Action.HOLD:
        # so that a user can fly out of it again
        return Response(action=action, takeover=Takeover.MODE_SWITCH_ONLY, clear=Clear.ON_MODE_CHANGE_OR_DISARM)
    if action in (Action.RETURN, Action.LAND):
        return Response(action=action, clear=Clear.ON_MODE_CHANGE_OR_DISARM)
    return Response(action=action)
