"""A guardian with a vehicle in the plane behind it, which does at once as it is told in its mode, for the tests."""

from dataclasses import replace

import numpy as np
from guardian_bench import DT, status

from companion.geometry.rotations import rotation_about_z
from companion.guardian.guardian import Guardian
from companion.guardian.parameters import GuardianParameters
from companion.messages.guardian import GuardianState
from companion.messages.ownship import FlightMode, OwnshipState


class PlanarBench:
    """Ticks the guardian; the autopilot grants what is asked. Subclasses say how the vehicle obeys a setpoint."""

    mode: FlightMode  # in which it obeys

    def __init__(self, shaper, *, armed=True, **parameters):
        self.guardian = Guardian(GuardianParameters(**parameters), shaper)
        self.t, self.yaw = 0.0, 0.0
        self.place, self.velocity = np.zeros(3), np.zeros(3)
        self.status = status(mode=FlightMode.AUTO_LOITER, armed=armed)
        self.trajectory = self.target = self.out = self.ownship = None
        self.odometry = True
        self.requests, self.setpoints, self.speeds = [], [], []

    def obey(self, setpoint):
        raise NotImplementedError

    def tick(self):
        self.t += DT
        if self.odometry:
            self.ownship = OwnshipState(
                t=self.t,
                position_ned=self.place,
                velocity_ned=self.velocity,
                acceleration_ned=np.zeros(3),
                ned_from_frd=rotation_about_z(self.yaw),
                angular_velocity_frd=np.zeros(3),
                reset_counter=0,
            )
        self.out = self.guardian.tick(self.t, self.ownship, self.status, self.trajectory, self.target)
        if self.out.request is not None:
            self.requests.append(self.out.request)
            self.status = replace(self.status, mode=self.out.request.mode)
        if self.out.setpoint is not None:
            self.setpoints.append(self.out.setpoint)
            if self.status.mode is self.mode:
                self.obey(self.out.setpoint)
        self.place = self.place + DT * self.velocity
        self.speeds.append(float(np.linalg.norm(self.velocity)))
        return self.out

    def run(self, seconds):
        for _ in range(round(seconds / DT)):
            self.tick()
        return self

    def engaged(self):
        self.guardian.engage(self.t)
        self.run(1.2)
        assert self.out.state is GuardianState.HOLDING, self.out
        return self


def assert_another_mode_mutes(bench, mode):
    """Engage it, let somebody change the mode, and see it fall silent in the same tick."""
    bench.engaged()
    bench.status = replace(bench.status, mode=mode)
    out = bench.tick()
    assert out.state is GuardianState.MUTED
    assert out.setpoint is None
