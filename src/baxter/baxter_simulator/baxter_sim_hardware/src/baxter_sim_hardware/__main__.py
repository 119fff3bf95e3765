# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m baxter_sim_hardware``: compile everything into the cache, so that no start has to wait for it."""
import numpy as np

from baxter_sim_hardware import effects
from baxter_sim_hardware.arms import avoidance
from baxter_sim_hardware.arms.actuators import Actuators, Wanted
from baxter_sim_hardware.arms.joint_sensors import JointSensors
from baxter_sim_hardware.arms.safety import blocks_of
from baxter_sim_hardware.arms.setpoint import SetPoints, any_beyond, approach, follow


def main():
    here, at_rest, bound = np.zeros(1), np.zeros(1), np.ones(1)
    approach(here, at_rest, here, bound, bound, 1.0)
    points = SetPoints(1)
    follow(points.numbers, points.flags, np.zeros((1, 1)), 0, here, 1.0, 1.0)
    any_beyond(1.0, here, at_rest, here, 1.0)
    numbers = effects.read(effects.physical_robot())
    sensors = JointSensors(numbers["noise"], ["left_s0"], 0, 0)
    sensors.reached(sensors.felt(here), np.arange(1))
    actuators = Actuators(numbers["lag"], ["left_s0"])
    actuators.torques(Wanted(bound > 0.0, here, at_rest, bound > 0.0, here, bound), np.ones((3, 1)), 1.0)
    frames, rates = (np.zeros((8, 3, 3)), np.zeros((8, 3))), np.zeros(7)
    avoidance.field(avoidance.Guards(("guard",), np.zeros((1, 3)), bound), *frames, rates)
    avoidance.between(frames, frames, rates, 1.0, 1.0)
    avoidance.around(blocks_of(numbers["body"]), frames, rates, 1.0, 1.0)


if __name__ == "__main__":
    main()
