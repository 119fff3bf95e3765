# SPDX-License-Identifier: BSD-3-Clause
"""What a physical arm's joints say of themselves: in counts, and with noise."""
import numpy as np

from baxter_sim_hardware import effects

QUANTITIES = ("position", "velocity", "effort")


class JointSensors:
    """The sensors of n joints.

    rows: {number: {joint: value}} as `effects.read` has them for "noise"; names: of the joints; random:
    numpy.random.Generator. Raises HardwareError.
    """

    def __init__(self, rows, names, random):
        self._quanta = [effects.per_joint(rows, "%s_quantum" % quantity, names) for quantity in QUANTITIES]
        for quantity, quantum in zip(QUANTITIES, self._quanta, strict=True):
            if quantum.min() <= 0.0:
                raise effects.HardwareError("%s_quantum is %g; it must be greater than 0" % (quantity, quantum.min()))
        self._noise = {quantity: effects.per_joint(rows, "%s_noise" % quantity, names)
                       for quantity in ("position", "effort")}
        self._random = random

    def read(self, position, velocity, effort):
        """What is read of the joints: the same three (n,), [rad], [rad/s] and [Nm]."""
        count = len(position)
        position = position + self._noise["position"] * self._random.standard_normal(count)
        effort = effort + self._noise["effort"] * self._random.standard_normal(count)
        return tuple(quantum * np.round(values / quantum)
                     for quantum, values in zip(self._quanta, (position, velocity, effort), strict=True))
