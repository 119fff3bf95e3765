# SPDX-License-Identifier: BSD-3-Clause
"""Commands of the joint drives of the arms for one tick."""
from typing import NamedTuple

import numpy as np

NO_JOINTS = np.zeros(0, dtype=int)


class Drives(NamedTuple):
    """Commands of the joint drives for this tick; indices count the joints of the limits.

    position_driven: indices of joints that follow position [rad] and velocity [rad/s] with up to effort [Nm];
    velocity_driven: indices of joints that are pushed towards push_velocity [rad/s] by no more than push_effort [Nm];
    effort_driven: indices of joints on which exerted [Nm] acts.
    """

    position_driven: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    velocity_driven: np.ndarray
    push_velocity: np.ndarray
    push_effort: np.ndarray
    effort_driven: np.ndarray = NO_JOINTS
    exerted: np.ndarray = np.zeros(0)
