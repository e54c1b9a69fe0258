"""A small synthetic world: a vehicle whose odometry wanders follows a target that a noisy, late camera sees.

It shares no code with the estimator beyond the messages. The vehicle flies by its estimate, so what wanders in truth is
the vehicle. Figures of the wander: hover of PX4's simulation-in-hardware (std 0.09, 0.19, 0.43 m; velocity 0.12, 0.28,
0.21 m/s).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from companion.geometry.rotations import rotation_from_euler
from companion.messages.ownship import OwnshipState
from companion.messages.target import TargetMeasurement

STEP = 0.01  # [s]


@dataclass(kw_only=True)
class Settings:
    motion: str = "static"  # static, straight, circle, sine, random, stop_and_go
    duration: float = 20.0
    speed: float = 0.5
    wander: float = 1.0  # scale of the odometry's error
    tilt_bias: tuple[float, float] = (0.0175, 0.0105)  # [rad] roll, pitch
    tilt_wander: tuple[float, float] = (0.014, 0.0105)  # [rad]
    tilt_time: tuple[float, float] = (2.5, 6.0)  # [s]
    noise_lateral: float = 0.0015  # [m per m of range]
    noise_range: float = 0.003  # [m per m of range]
    noise_heading: float = 0.002  # [rad per m of range]
    latency: float = 0.05  # [s]
    jitter: float = 0.0  # [s] extra latency, uniform: large values bring measurements out of order
    dropout: float = 0.1
    blind: float = 0.0  # [s] without any measurement after each `sight`, from the first `sight` on
    sight: float = 5.0  # [s]
    outliers: float = 0.0
    rate: float = 30.0  # [Hz] of the camera
    frame_yaw: float = 0.0  # the odometry's frame against the world's: a turn
    frame_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass
class Run:
    times: np.ndarray
    own: np.ndarray  # (n, 4) true north east down yaw
    estimated: np.ndarray  # (n, 4) in the odometry's frame
    estimated_velocity: np.ndarray  # (n, 3)
    target: np.ndarray  # (n, 4) true
    ownships: list[OwnshipState] = field(default_factory=list)
    measurements: list[tuple[float, TargetMeasurement]] = field(default_factory=list)  # (arrival, measurement)

    def truth(self, t: float) -> np.ndarray:
        """Relative pose (4,) in the true level frame."""
        own = interpolate(self.times, self.own, t)
        target = interpolate(self.times, self.target, t)
        return relative(target, own)

    def apparent(self, t: float) -> np.ndarray:
        """The target's pose (4,) in the odometry's frame, as a perfect estimate would place it."""
        own = interpolate(self.times, self.estimated, t)
        place = self.truth(t)
        c, s = math.cos(own[3]), math.sin(own[3])
        return np.array(
            [
                own[0] + c * place[0] - s * place[1],
                own[1] + s * place[0] + c * place[1],
                own[2] + place[2],
                own[3] + place[3],
            ]
        )


def interpolate(times: np.ndarray, rows: np.ndarray, t: float) -> np.ndarray:
    i = min(max(int(t / STEP), 0), len(times) - 2)
    u = t / STEP - i
    return (1.0 - u) * rows[i] + u * rows[i + 1]


def relative(target: np.ndarray, own: np.ndarray) -> np.ndarray:
    c, s = math.cos(own[3]), math.sin(own[3])
    n, e = target[0] - own[0], target[1] - own[1]
    return np.array([c * n + s * e, c * e - s * n, target[2] - own[2], target[3] - own[3]])


def gauss_markov(rng: np.random.Generator, n: int, sigma: float, time: float) -> np.ndarray:
    decay = math.exp(-STEP / time)
    kick = sigma * math.sqrt(1.0 - decay * decay)
    out = np.empty(n)
    out[0] = sigma * rng.standard_normal()
    noise = kick * rng.standard_normal(n)
    for i in range(1, n):
        out[i] = decay * out[i - 1] + noise[i]
    return out


def smooth_gauss_markov(rng: np.random.Generator, n: int, sigma: float, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Critically damped second-order Gauss-Markov process and its derivative, std `sigma` and `sigma / time`."""
    w = 1.0 / time
    e = math.exp(-w * STEP)
    a = e * np.array([[1.0 + w * STEP, STEP], [-w * w * STEP, 1.0 - w * STEP]])
    stationary = np.diag([sigma**2, (sigma * w) ** 2])
    kick = np.linalg.cholesky(stationary - a @ stationary @ a.T + 1e-15 * np.eye(2))
    x = np.array([sigma, sigma * w]) * rng.standard_normal(2)
    noise = rng.standard_normal((n, 2)) @ kick.T
    out = np.empty((n, 2))
    for i in range(n):
        out[i] = x
        x = a @ x + noise[i]
    return out[:, 0], out[:, 1]


def wandering(
    rng: np.random.Generator, n: int, sigma: float, time: float, decay: float
) -> tuple[np.ndarray, np.ndarray]:
    """Error of a position and of its velocity: the velocity's is smooth above 1 Hz, the position's is pulled back."""
    drive = gauss_markov(rng, n, sigma * math.sqrt((time + 0.3) / time), time)
    position, velocity = np.empty(n), np.empty(n)
    p, v = 0.0, float(drive[0])
    for i in range(n):
        position[i], velocity[i] = p, v
        p += STEP * (v - decay * p)
        v += STEP / 0.3 * (drive[i] - v)
    return position, velocity


def target_motion(rng: np.random.Generator, n: int, settings: Settings) -> np.ndarray:
    target = np.zeros((n, 4))
    heading = rng.uniform(-math.pi, math.pi)
    position = rng.uniform(-1.0, 1.0, 2)
    speed, turn = 0.0, 0.0
    for i in range(n):
        t = i * STEP
        if settings.motion == "straight":
            speed = settings.speed
        elif settings.motion == "stop_and_go":
            speed = settings.speed if (t % 6.0) < 3.0 else 0.0
        elif settings.motion == "circle":
            speed, turn = settings.speed, 0.2
        elif settings.motion == "sine":  # a wave of 5 m by 1 m, as in table 2 of Patel et al.
            speed = settings.speed
            phase = 2.0 * math.pi * speed * t / 5.0
            turn = -0.5 * (2.0 * math.pi / 5.0) ** 2 * speed * math.sin(phase)
        elif settings.motion == "random" and i % 10 == 0:
            speed, turn = rng.uniform(0.0, settings.speed), rng.uniform(-1.0, 1.0)
        target[i] = position[0], position[1], -0.15, heading
        position = position + STEP * speed * np.array([math.cos(heading), math.sin(heading)])
        heading += STEP * turn
    return target


def build(seed: int, settings: Settings) -> Run:
    rng = np.random.default_rng(seed)
    n = int(settings.duration / STEP) + 50
    times = np.arange(n) * STEP
    target = target_motion(rng, n, settings)
    error, velocity_error = np.zeros((n, 4)), np.zeros((n, 3))
    for axis, (sigma, time, decay) in enumerate(((0.12, 6.0, 1.2), (0.28, 2.2, 1.3), (0.21, 3.2, 0.4))):
        error[:, axis], velocity_error[:, axis] = wandering(rng, n, settings.wander * sigma, time, decay)
    error[:, 3], _ = smooth_gauss_markov(rng, n, settings.wander * 0.028, 4.0)
    estimated, velocity = commanded(rng, times, target, settings)
    own = estimated - error
    run = Run(times, own, estimated, velocity + velocity_error, target)
    into_frame(run, settings)
    attitude = [smooth_gauss_markov(rng, n, 0.02, 0.3) for _ in range(2)]
    for i in range(0, n, 2):
        run.ownships.append(ownship_at(run, i, attitude))
    tilt = [
        bias * rng.standard_normal() + gauss_markov(rng, n, sigma, time)
        for bias, sigma, time in zip(settings.tilt_bias, settings.tilt_wander, settings.tilt_time, strict=True)
    ]
    measure(rng, run, settings, tilt)
    return run


def commanded(
    rng: np.random.Generator, times: np.ndarray, target: np.ndarray, settings: Settings
) -> tuple[np.ndarray, np.ndarray]:
    """Fly over the target, then descend: the estimated pose and its velocity."""
    n = len(times)
    smooth = np.stack([np.convolve(np.pad(c, 50, "edge"), np.ones(101) / 101, "valid") for c in target.T], axis=1)
    pose = np.zeros((n, 4))
    away = rng.uniform(2.0, 3.0) * np.exp(-times / 2.0)
    bearing = rng.uniform(-math.pi, math.pi)
    height = 1.5 + 2.0 / (1.0 + np.exp((times - 0.6 * settings.duration) / 1.5))
    pose[:, 0] = smooth[:, 0] + away * math.cos(bearing) + smooth_gauss_markov(rng, n, 0.05, 0.8)[0]
    pose[:, 1] = smooth[:, 1] + away * math.sin(bearing) + smooth_gauss_markov(rng, n, 0.05, 0.8)[0]
    pose[:, 2] = -0.15 - height
    pose[:, 3] = rng.uniform(-math.pi, math.pi) + 0.3 * np.sin(times / 3.0)
    return pose, np.gradient(pose[:, :3], STEP, axis=0)


def into_frame(run: Run, settings: Settings) -> None:
    """Turn and shift the odometry's frame."""
    c, s = math.cos(settings.frame_yaw), math.sin(settings.frame_yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    run.estimated = np.column_stack(
        [run.estimated[:, :3] @ turn.T + np.array(settings.frame_shift), run.estimated[:, 3] + settings.frame_yaw]
    )
    run.estimated_velocity = run.estimated_velocity @ turn.T


def ownship_at(run: Run, i: int, attitude: list[tuple[np.ndarray, np.ndarray]]) -> OwnshipState:
    (roll, roll_rate), (pitch, pitch_rate) = attitude
    return OwnshipState(
        t=float(run.times[i]),
        position_ned=run.estimated[i, :3],
        velocity_ned=run.estimated_velocity[i],
        acceleration_ned=np.zeros(3),
        ned_from_frd=rotation_from_euler(float(roll[i]), float(pitch[i]), float(run.estimated[i, 3])),
        angular_velocity_frd=np.array([roll_rate[i], pitch_rate[i], 0.0]),
        reset_counter=11,
    )


def measure(rng: np.random.Generator, run: Run, settings: Settings, tilt: list[np.ndarray]) -> None:
    t = 0.5
    while t < settings.duration and t + 1.0 / settings.rate < run.times[-1]:
        t += 1.0 / settings.rate
        draws = rng.standard_normal(4)
        dropped, outlier, delay = rng.random(), rng.random(), rng.random()
        kick = rng.uniform(-1.0, 1.0, 4)
        blind = settings.blind > 0.0 and (t - 0.5) % (settings.sight + settings.blind) > settings.sight
        if dropped < settings.dropout or blind:
            continue
        place = run.truth(t)
        i = int(t / STEP)
        a, b = tilt[0][i], tilt[1][i]
        n, e, d, heading = place
        turned = np.array([n + b * d, e - a * d, d + a * e - b * n, heading])
        distance = float(np.linalg.norm(place[:3]))
        lateral = 0.002 + settings.noise_lateral * distance
        sigma = np.array(
            [lateral, lateral, 0.002 + settings.noise_range * distance, 0.002 + settings.noise_heading * distance]
        )
        value = turned + sigma * draws
        if outlier < settings.outliers:
            value = value + kick * np.array([1.0, 1.0, 1.0, 2.0])
        measurement = TargetMeasurement(
            t=t, position_level=value[:3], heading=float(value[3]), covariance=np.diag(sigma**2)
        )
        run.measurements.append((t + settings.latency + settings.jitter * delay, measurement))
    run.measurements.sort(key=lambda item: item[0])


def corrupted(run: Run, share: float, seed: int, *, told: bool = False) -> Run:
    """Replace a share of the measurements by a random range, bearing and heading; `told`: leave those out instead."""
    rng = np.random.default_rng(seed)
    measurements = []
    for arrival, measurement in run.measurements:
        draws, dice = rng.random(4), rng.random()
        distance, bearing, slant = 0.5 + 5.5 * draws[0], 2.0 * math.pi * draws[1], 0.42 * draws[2]
        aside = distance * math.sin(slant)
        place = np.array([aside * math.cos(bearing), aside * math.sin(bearing), distance * math.cos(slant)])
        if dice >= share:
            measurements.append((arrival, measurement))
        elif not told:
            wrong = replace(measurement, position_level=place, heading=2.0 * math.pi * (draws[3] - 0.5))
            measurements.append((arrival, wrong))
    return replace(run, measurements=measurements)
