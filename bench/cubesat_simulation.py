"""Time that the docking simulator takes for one simulated second: truth and sensors, nozzles pulsing, markers in sight.

.venv/bin/python bench/cubesat_simulation.py [--seconds 60]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from sitl_stub.cubesat.simulation import CubesatSimulation
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import DockingWorld


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="simulated time")
    seconds = parser.parse_args().seconds
    vehicle, world = CubesatVehicle.load(), DockingWorld.load("docking")
    # half a metre before the docking face, with nozzles too weak to leave: all work is done, the markers stay in sight
    vehicle = replace(vehicle, propulsion=replace(vehicle.propulsion, thrust=1e-7))
    chaser = replace(world.chaser, position=(1.0, 1.4, 1.0), quaternion=world.target.quaternion)
    simulation = CubesatSimulation(vehicle, replace(world, chaser=chaser), seed=1)
    dice = np.random.default_rng(1)
    kinds: dict[str, int] = {}
    begin = time.process_time()
    for period in range(round(seconds / vehicle.propulsion.period)):
        on_times = np.where(dice.random(10) < 0.4, dice.uniform(0.01, 0.05, 10), 0.0)
        simulation.command(simulation.t, on_times.tolist())
        simulation.advance((period + 1) * vehicle.propulsion.period)
        for reading in simulation.readings():
            kinds[type(reading).__name__] = kinds.get(type(reading).__name__, 0) + 1
    used = time.process_time() - begin
    print(f"{1e3 * used / seconds:.2f} ms of one core per simulated second; readings: {kinds}")


if __name__ == "__main__":
    main()
