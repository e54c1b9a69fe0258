"""The strips over time of a docking: range, errors of the estimate, attitude, speed, impulse."""

from __future__ import annotations

from typing import Any

import numpy as np

from companion.report.docking_series import DockingRun
from companion.report.strips import KEY, draw_bands, draw_seen, log_scale, shown
from companion.report.style import FAINT, INK, PAD, SERIES, VEHICLE

_SETTLED = 3.0  # [s] the first errors, of what was told at the start, do not set the scale
_R1_R2 = (("reorient_range_m", "r2"), ("align_range_m", "r1"))


def draw_port_seen(axes: Any, run: DockingRun) -> None:
    """Draw when the port was in sight."""
    draw_seen(axes, run, what="port seen")


def draw_range(axes: Any, run: DockingRun) -> None:
    """Draw the distance from the docked place, over the bands of the modes, with the switching distances."""
    draw_bands(axes, run)
    axes.plot(run.t, run.range, color=VEHICLE, linewidth=1.6)
    figures = {} if run.result is None else run.result.get("docking") or {}
    for key, name in _R1_R2:
        value = figures.get(key)
        if value is not None:
            axes.axhline(value, color=FAINT, linewidth=0.8, linestyle=(0, (3, 3)))
            axes.annotate(
                f"{name} = {value:.2f} m", (1.0, value), xycoords=("axes fraction", "data"), ha="right", va="bottom"
            )
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("range [m]")


def draw_position_errors(axes: Any, run: DockingRun) -> None:
    """Draw the estimate's error along each axis of c inside its three standard deviations."""
    estimate = run.estimate
    draw_bands(axes, run)
    for axis, colour in enumerate(SERIES[:3]):
        reach = 3000.0 * estimate.position_std[:, axis]
        axes.fill_between(estimate.t, -reach, reach, color=colour, alpha=0.10, linewidth=0)
        axes.plot(estimate.t, reach, color=colour, linewidth=0.6, linestyle=":")
        axes.plot(estimate.t, -reach, color=colour, linewidth=0.6, linestyle=":")
        label = f"{'xyz'[axis]}, beside 3 sigma"
        axes.plot(estimate.t, 1000.0 * estimate.position_error[:, axis], color=colour, linewidth=0.9, label=label)
    later = estimate.t > estimate.t[0] + _SETTLED
    if later.any():
        most = 3150.0 * float(estimate.position_std[later].max())
        axes.set_ylim(-most, most)
    axes.legend(**KEY)
    axes.set_ylabel("position error\nof the estimate\n[mm]")


def draw_attitudes(axes: Any, run: DockingRun) -> None:
    """Draw the angle from the docking attitude, and the estimate's error beside three standard deviations."""
    estimate = run.estimate
    draw_bands(axes, run)
    sigma = shown(3.0 * estimate.attitude_std)
    axes.plot(estimate.t, sigma, color=PAD, linewidth=1.0, linestyle=":", label="3 sigma, worst axis")
    axes.plot(estimate.t, shown(estimate.attitude_error), color=PAD, linewidth=0.9, label="of the estimate")
    axes.plot(run.t, shown(run.attitude), color=VEHICLE, linewidth=1.5, label="from the docking attitude")
    log_scale(axes)
    axes.set_ylabel("attitude\nerror [rad]")


def draw_docking_speed(axes: Any, run: DockingRun) -> None:
    """Draw the true speed and the goal's."""
    draw_bands(axes, run)
    speed = np.linalg.norm(run.truth.velocity, axis=1)
    axes.plot(run.t, 1000.0 * speed, color=VEHICLE, linewidth=1.2, label="chaser")
    t, goal = run.goal_speed
    axes.plot(t, 1000.0 * goal, color=INK, linewidth=0.9, linestyle="--", label="its goal")
    axes.set_ylim(bottom=0.0)
    axes.legend(**KEY)
    axes.set_ylabel("speed [mm/s]")


def draw_impulse(axes: Any, run: DockingRun) -> None:
    """Draw the impulse of all nozzles so far."""
    draw_bands(axes, run)
    axes.plot(run.t, run.truth.impulse, color=SERIES[3], linewidth=1.5)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("impulse [N s]")
