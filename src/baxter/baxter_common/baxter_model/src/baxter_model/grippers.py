# SPDX-License-Identifier: BSD-3-Clause
"""The kinds of gripper that an arm can carry."""
from typing import NamedTuple


class GripperKind(NamedTuple):
    """One kind.

    name: as in Gripper.type() and the description's arguments; ui_type, id: as in EndEffectorProperties and
    EndEffectorCommand; parameters: {name: value at the start}.
    """

    name: str
    ui_type: int
    id: int
    parameters: dict


# [%], [s]
SUCTION = GripperKind("suction", 1, 65537, {"vacuum_sensor_threshold": 18.0, "blow_off_seconds": 0.4})
# [%]
ELECTRIC = GripperKind("electric", 2, 65538,
                       {"velocity": 50.0, "moving_force": 40.0, "holding_force": 30.0, "dead_zone": 5.0})
# A custom tool or a bare arm: the robot does not distinguish them.
CUSTOM = GripperKind("custom", 3, 131073, {})
