# SPDX-License-Identifier: BSD-3-Clause
"""What a physical arm's joints say of themselves: in counts, and with noise."""
import numpy as np

from baxter_sim_hardware import effects

QUANTITIES = ("position", "velocity", "effort")


class JointSensors:
    """The sensors of n joints.

    rows: {number: {joint: value}} as `effects.read` has them for "noise"; names: of the joints; seed: integer of the
    noise, 0 or more. Raises HardwareError.
    """

    def __init__(self, rows, names, seed):
        self._quanta = [effects.per_joint(rows, "%s_quantum" % quantity, names) for quantity in QUANTITIES]
        for quantity, quantum in zip(QUANTITIES, self._quanta, strict=True):
            if quantum.min() <= 0.0:
                raise effects.HardwareError("%s_quantum is %g; it must be greater than 0" % (quantity, quantum.min()))
        self._noise = {quantity: effects.per_joint(rows, "%s_noise" % quantity, names)
                       for quantity in ("position", "effort")}
        self._seed = seed

    def read(self, tick, position, velocity, effort):
        """What is read of the joints in this tick: the same three (n,), [rad], [rad/s] and [Nm].

        The noise of a tick follows from its number, so it does not depend on who listens, and when.
        """
        of_position, of_effort = np.random.Generator(
            np.random.Philox(key=self._seed, counter=[0, tick, 0, 0])).standard_normal((2, len(position)))
        position = position + self._noise["position"] * of_position
        effort = effort + self._noise["effort"] * of_effort
        return tuple(quantum * np.round(values / quantum)
                     for quantum, values in zip(self._quanta, (position, velocity, effort), strict=True))
