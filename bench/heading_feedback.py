"""How well a heading can be followed that turns at random, and how well the feedback does: docs/papers.md.

    python bench/heading_feedback.py

The target of Patel et al., table 4, draws a turn rate in [-1, 1] rad/s ten times a second. The vehicle is an X500 under
PX4 v1.17: yaw torque 0.2 of the rate's error with its integral, smoothed with 2 Hz, rotors of 35 ms. Printed is the
mean of the heading's error [rad]: of an optimal linear feedback (LQR) that knows every state of the vehicle and weighs
its demand less and less, with and without a limit on the demand's change; and of `HeadingFeedback`.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from companion.control.heading_feedback import HeadingFeedback
from companion.control.relative_feedback import RelativeFeedbackParameters
from companion.geometry.angles import wrap_angle
from companion.messages.motion import MotionState

STEP = 0.02  # [s] of the control
SEEN_LATE = 3  # steps: picture, detection, filter
SENT_LATE = 1  # steps: link
RATE_MAX = 1.0  # [rad/s] of the demand
GAIN = 2.8  # [1/s] MC_YAW_P
RUNS, STEPS, DRAWN_EVERY = 8, 3000, 5
POWER, DRAG = 0.016 * 40.8 / 0.04, 0.006 / 0.04  # [rad/s^2] of a whole torque, [1/s]
SMOOTHING, ROTORS = 1.0 / (4.0 * math.pi), 0.035  # [s]
RATE_P, RATE_I = 0.2, 0.1  # MC_YAWRATE_P, MC_YAWRATE_I
STATES = 5  # heading, rate, torque smoothed, torque of the rotors, integral


def plant() -> tuple[np.ndarray, np.ndarray]:
    """Give the plant's transition (5, 5) and input (5,) over a step; the input is the demanded rate [rad/s]."""
    flow = np.zeros((STATES + 1, STATES + 1))
    flow[0, 1] = 1.0
    flow[1, [1, 3]] = -DRAG, POWER
    flow[2, [1, 2, 4, 5]] = np.array([-RATE_P, -1.0, 1.0, RATE_P]) / SMOOTHING
    flow[3, [2, 3]] = np.array([1.0, -1.0]) / ROTORS
    flow[4, [1, 5]] = -RATE_I, RATE_I
    over = expm(STEP * flow)
    return over[:STATES, :STATES], over[:STATES, STATES]


def optimal_gain(transition: np.ndarray, effect: np.ndarray, weight: float) -> np.ndarray:
    """Give the LQR's gain (6,) on the plant's states, heading relative to the target's, and the demand under way."""
    size = STATES + SENT_LATE
    wide, enters = np.zeros((size, size)), np.zeros((size, 1))
    wide[:STATES, :STATES], wide[:STATES, STATES] = transition, effect
    enters[-1] = 1.0
    cost = np.zeros((size, size))
    cost[0, 0] = 1.0
    value = solve_discrete_are(wide, enters, cost, np.array([[weight]]))
    gain: np.ndarray = np.linalg.solve(enters.T @ value @ enters + weight, enters.T @ value @ wide)[0]
    return gain


def headings(seed: int) -> np.ndarray:
    """Give the target's heading (3000,) [rad] at every step."""
    rates = np.random.default_rng(seed).uniform(-1.0, 1.0, STEPS // DRAWN_EVERY).repeat(DRAWN_EVERY)
    walked: np.ndarray = np.cumsum(rates) * STEP
    return walked


def standing(yaw: float) -> MotionState:
    """Give a heading that is kept."""
    zero = np.zeros(3)
    return MotionState(position_ned=zero, velocity_ned=zero, acceleration_ned=zero, yaw=yaw, yaw_rate=0.0)


def flown(gain: np.ndarray | None, seed: int, slew: float = math.inf) -> float:
    """Give the mean heading error [rad] of a run: with the LQR's gain, or None for `HeadingFeedback`.

    `slew` [rad/s^2] limits the change of the demand.
    """
    transition, effect = plant()
    target, state, demand, total = headings(seed), np.zeros(STATES), 0.0, 0.0
    feedback = HeadingFeedback(RelativeFeedbackParameters(), gain=GAIN, rate_max=RATE_MAX, near=0.15)
    for step in range(STEPS):
        seen = float(target[max(0, step - SEEN_LATE)])
        if gain is not None:
            relative = np.append(state, demand)
            relative[0] -= seen
            wanted = -float(gain @ relative)
        else:
            goal, yaw = standing(seen), float(state[0])
            turn = feedback.update(
                step * STEP, STEP, goal=lambda _, to=goal: to, calm=True, plan=goal, yaw=yaw, yaw_rate=float(state[1])
            )
            wanted = GAIN * wrap_angle(seen + turn - yaw)
        wanted = max(-RATE_MAX, min(RATE_MAX, wanted))
        state = transition @ state + effect * demand
        demand = max(demand - slew * STEP, min(demand + slew * STEP, wanted))
        total += abs(float(target[step] - state[0]))
    return total / STEPS


def main() -> None:
    """Print the table."""
    transition, effect = plant()
    print(f"mean heading error [rad] over {RUNS} runs of {STEPS * STEP:.0f} s")
    for weight in (0.1, 0.03, 0.01, 0.003, 0.001):
        gain = optimal_gain(transition, effect, weight)
        free = np.mean([flown(gain, seed) for seed in range(RUNS)])
        bound = np.mean([flown(gain, seed, 2.0) for seed in range(RUNS)])
        print(f"optimal, weight of the demand {weight:5}: {free:.3f}; its change limited to 2 rad/s^2: {bound:.3f}")
    print(f"HeadingFeedback: {np.mean([flown(None, seed) for seed in range(RUNS)]):.3f}")


if __name__ == "__main__":
    main()
