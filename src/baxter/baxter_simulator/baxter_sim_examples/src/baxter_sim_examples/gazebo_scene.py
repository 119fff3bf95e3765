# SPDX-License-Identifier: BSD-3-Clause
"""The scene in a running simulator: spawn and delete table and block, read the block's pose."""
from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import rospkg
import rospy
from gazebo_msgs.srv import GetModelState, GetWorldProperties, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion

from gazebo_ros.gazebo_interface import GazeboInterfaceError, call, delete_model_client

from .scene import BASE_HEIGHT_M, TABLE_XY_M, block_urdf

if TYPE_CHECKING:
    from .clutter import ClutterItem
    from .pick_and_place import Spot
    from .scene import Trial

GAZEBO = "/gazebo"
TABLE, BLOCK = "cafe_table", "block"


class GazeboScene:
    """Table and block for one Trial, with other things on the table, in the world as long as a `with` lasts.

    Raises GazeboInterfaceError.
    """

    def __init__(self, trial: Trial, things: Iterable[ClutterItem] = ()) -> None:
        """things: list of clutter.Things."""
        self._trial, self._things = trial, list(things)

    def __enter__(self) -> GazeboScene:
        self._remove()
        table = Path(rospkg.RosPack().get_path("model_files")) / "models" / TABLE / "model.sdf"
        self._spawn("sdf", TABLE, table.read_text(), Pose(Point(*TABLE_XY_M, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)))
        self._spawn("urdf", BLOCK, block_urdf(self._trial.mass_kg, self._trial.friction), _pose(self._trial.source))
        for thing in self._things:
            self._spawn("urdf", thing.name, thing.urdf(), _pose(thing.spot))
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._remove()
        except GazeboInterfaceError as error:
            rospy.logwarn("table and block stay in the world: %s", error)

    def distance(self, spot: Spot) -> float:
        """Distance [m] of the block's middle from a Spot."""
        return math.dist(_where(BLOCK), _point(_pose(spot)))

    def height(self) -> float:
        """Height [m] of the block's middle in `base`."""
        return _where(BLOCK)[2] - BASE_HEIGHT_M

    def touched(self, tolerance_m: float) -> str | None:
        """A sentence on the first thing that has moved by more than `tolerance_m`, None where all stand still."""
        for thing in self._things:
            moved = math.dist(_where(thing.name), _point(_pose(thing.spot)))
            if moved > tolerance_m:
                return "'%s': it has moved by %.1f mm" % (thing.name, 1e3 * moved)
        return None

    def _spawn(self, kind, name, xml, pose):
        answer = call("%s/spawn_%s_model" % (GAZEBO, kind), SpawnModel, name, xml, "/", pose, "world")
        if not answer.success:
            raise GazeboInterfaceError("model '%s' cannot be spawned: %s" % (name, answer.status_message))

    def _remove(self):
        there = call(GAZEBO + "/get_world_properties", GetWorldProperties).model_names
        for name in (BLOCK, *(thing.name for thing in self._things), TABLE):
            if name in there:
                delete_model_client(name, GAZEBO)


def _where(model):
    """x, y, z [m] of a model in the physics world."""
    state = call(GAZEBO + "/get_model_state", GetModelState, model, "world")
    if not state.success:
        raise GazeboInterfaceError("where is model '%s'? %s" % (model, state.status_message))
    return _point(state.pose)


def _point(pose):
    return pose.position.x, pose.position.y, pose.position.z


def _pose(spot):
    """A Spot as a pose in the physics world, whose floor is at z = 0."""
    return Pose(Point(spot.x, spot.y, spot.z + BASE_HEIGHT_M),
                Quaternion(0.0, 0.0, math.sin(spot.yaw / 2.0), math.cos(spot.yaw / 2.0)))
