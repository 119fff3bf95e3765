# SPDX-License-Identifier: BSD-3-Clause
"""Joints of type gearbox, and the threads of screws: they couple two joints that move."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from urdf_model import Gear


@dataclass
class Gearbox:
    """A joint of type gearbox: the child's angle about its axis from the reference body is -ratio times the parent's
    about its own. The axes (3,) are unit, in the model."""

    name: str
    parent: str
    child: str
    reference: str
    ratio: float
    axes: tuple[np.ndarray, np.ndarray]
    element: Any

    def moved(self, prefix: str, turn: np.ndarray) -> "Gearbox":
        """The same in an enclosing model, whose axes are turned by ``turn`` (3, 3)."""
        parent, child, reference = (end if end == "world" else prefix + end
                                    for end in (self.parent, self.child, self.reference))
        return Gearbox(prefix + self.name, parent, child, reference, self.ratio,
                       (turn @ self.axes[0], turn @ self.axes[1]), self.element)


def gear_of(gearbox: Gearbox, joints: list) -> Gear:
    """Return the Gear between two of the SdfJoints ``joints``. Raises ValueError where there is no hinge between the
    reference body and the parent or the child."""
    names, signs = [], []
    for link, axis in zip((gearbox.parent, gearbox.child), gearbox.axes, strict=True):
        ends = {link, gearbox.reference}
        joint = next((joint for joint in joints if {joint.parent, joint.child} == ends
                      and joint.type in ("revolute", "continuous")), None)
        if joint is None:
            raise ValueError("no hinge joins '%s' and the reference body '%s'" % (link, gearbox.reference))
        turn = float(np.sign((joint.frame[:3, :3] @ joint.axis) @ axis)) or 1.0
        names.append(joint.name)
        signs.append(turn if joint.child == link else -turn)
    return Gear(names[0], names[1], -gearbox.ratio * signs[0] * signs[1])
