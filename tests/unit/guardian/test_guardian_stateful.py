"""Anything may happen in any order: the stream stays finite, bounded, slewed, fenced, and silent when it must be."""

import math
from dataclasses import replace

import numpy as np
from guardian_bench import DT, Bench, Path, line, motion, status, violations
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from companion.guardian.fence import Fence
from companion.messages.guardian import GuardianState, ModeRequest
from companion.messages.ownship import FlightMode, SystemStatus
from companion.messages.target import TargetPose

S = GuardianState
FENCE = Fence(radius=12.0, height_max=10.0, height_min=-5.0)
wild = st.one_of(st.floats(-20, 20), st.floats(allow_nan=True, allow_infinity=True))
vectors = st.tuples(wild, wild, wild)
tame = st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(-3, 3))


class GuardianMachine(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.bench = Bench(fence=FENCE)
        self.outputs = []
        self.engaged_by_operator = False
        self.wrong = []

    def tick(self, dt=DT):
        bench = self.bench
        outside = FENCE.excess(tuple(bench.position)) > 0
        before = self.outputs[-1] if self.outputs else None
        out = bench.tick(dt)
        self.wrong += violations([before, out] if before is not None else [out])
        self.outputs.append(out)
        s = out.setpoint
        position = None if s is None else s.position_ned
        if position is not None and not outside and FENCE.excess(tuple(position)) > 1e-6:
            self.wrong.append("outside of the fence")
        if position is not None:
            here = bench.ownship.position_ned + bench.ownship.velocity_ned * (out.t - bench.ownship.t)
            if math.hypot(*(position - here)[:2]) > 1.0 + 1e-6 or abs(position[2] - here[2]) > 1.0 + 1e-6:
                self.wrong.append("off the leash")
            if out.t - bench.ownship.t > 0.1 + 1e-9:
                self.wrong.append("position built on an old own state")
        if out.request is ModeRequest.OFFBOARD and not self.engaged_by_operator:
            self.wrong.append("asked for OFFBOARD without the operator")
        if out.state is S.MUTED:
            self.engaged_by_operator = False

    @rule(count=st.integers(1, 60))
    def time_passes(self, count):
        for _ in range(count):
            self.tick()

    @rule()
    def operator_engages(self):
        self.bench.guardian.engage(self.bench.t)
        self.engaged_by_operator = True

    @rule()
    def fly_on(self):
        """Bring it into the air on a trajectory, so that the other rules meet it there."""
        if self.outputs and self.outputs[-1].state is S.MUTED:
            self.bench.status = status()
            self.bench.odometry = True
            self.bench.position = np.array(FENCE.clamp(tuple(self.bench.position), 2.0))
            self.operator_engages()
            self.time_passes(60)
        self.bench.trajectory = line(
            self.bench.position, (1.0, 0.5, 0.0), self.bench.t, reset_counter=self.bench.reset_counter
        )
        self.time_passes(30)

    @rule(velocity=tame, offset=tame)
    def planner_gives_a_line(self, velocity, offset):
        start = self.bench.position + np.array(offset)
        self.bench.trajectory = line(start, velocity, self.bench.t, reset_counter=self.bench.reset_counter)

    @rule(frequency=st.floats(0.1, 8), size=st.floats(0, 5))
    def planner_gives_a_wave(self, frequency, size):
        centre, w = self.bench.position.copy(), frequency

        def wave(t):
            return motion(
                centre + size * math.sin(w * t) * np.array([1, 0.5, 0.3]),
                size * w * math.cos(w * t) * np.array([1, 0.5, 0.3]),
                -size * w * w * math.sin(w * t) * np.array([1, 0.5, 0.3]),
                yaw=w * t,
                yaw_rate=w,
            )

        self.bench.trajectory = Path(wave, reset_counter=self.bench.reset_counter)

    @rule(p=vectors, v=vectors, a=vectors, yaw=wild, rate=wild)
    def planner_gives_garbage(self, p, v, a, yaw, rate):
        state = motion(p, v, a, yaw, rate)
        self.bench.trajectory = Path(lambda _: state, reset_counter=self.bench.reset_counter)

    @rule()
    def planner_falls_silent(self):
        self.bench.trajectory = None

    @rule(offset=tame, velocity=vectors)
    def target_appears(self, offset, velocity):
        self.bench.target = TargetPose(
            t=self.bench.t,
            position_ned=self.bench.position + np.array(offset),
            velocity_ned=np.array(velocity),
            acceleration_ned=np.zeros(3),
            yaw=0.0,
            yaw_rate=0.0,
            covariance=np.eye(4),
        )

    @rule(mode=st.sampled_from([FlightMode.POSCTL, FlightMode.AUTO_RTL, FlightMode.OFFBOARD, FlightMode.TERMINATION]))
    def somebody_changes_the_mode(self, mode):
        flying = bool(self.outputs) and self.outputs[-1].state in (S.FOLLOWING, S.HOLDING, S.BLIND, S.GAP)
        self.bench.status = replace(self.bench.status, mode=mode)
        self.tick()
        if flying and mode is not FlightMode.OFFBOARD and self.outputs[-1].state is not S.MUTED:
            self.wrong.append("not mute after a change of mode")

    @rule(health=st.sampled_from([SystemStatus.CRITICAL, SystemStatus.ACTIVE, SystemStatus.BOOT]), armed=st.booleans())
    def autopilot_changes(self, health, armed):
        self.bench.status = replace(self.bench.status, system_status=health, armed=armed)

    @rule(connected=st.booleans(), valid=st.booleans())
    def link_or_estimate_comes_and_goes(self, connected, valid):
        self.bench.status = replace(self.bench.status, connected=connected, estimate_valid=valid)

    @rule()
    def all_is_well_again(self):
        self.bench.status = status(mode=self.bench.status.mode)
        self.bench.odometry = True

    @rule(seconds=st.floats(0.02, 1.5))
    def odometry_pauses(self, seconds):
        self.bench.odometry = False
        self.time_passes(max(1, int(seconds / DT)))
        self.bench.odometry = True

    @rule(pause=st.floats(0.02, 1.2))
    def program_stalls(self, pause):
        self.tick(pause)

    @rule(jump=tame, turn=st.floats(-3, 3), told=st.booleans())
    def estimate_jumps(self, jump, turn, told):
        self.bench.position = self.bench.position + np.array(jump)
        self.bench.yaw += turn
        if told:
            self.bench.reset_counter = (self.bench.reset_counter + 1) % 256

    @rule(stuck=st.booleans())
    def vehicle_is_held(self, stuck):
        self.bench.stuck = stuck

    @rule()
    def operator_disengages(self):
        self.bench.guardian.disengage(self.bench.t)

    @rule()
    def mission_finishes(self):
        self.bench.guardian.finish(self.bench.t)

    @invariant()
    def nothing_is_wrong(self):
        assert self.wrong == []


GuardianMachine.TestCase.settings = settings(
    max_examples=60, stateful_step_count=30, deadline=None, suppress_health_check=list(HealthCheck)
)
TestGuardianMachine = GuardianMachine.TestCase
