# SPDX-License-Identifier: BSD-3-Clause
"""The recorder of exercises on planning: it also reports the boxes in move_group's scene.

They come from a topic, in which a checked program has no part: a node that publishes on it meddles with the lab.
"""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from geometry_msgs.msg import Pose
from moveit_msgs.msg import CollisionObject, PlanningScene
from shape_msgs.msg import SolidPrimitive

from rf_checks.recorder import Recorder
from urdf_model.transforms import matrix_from_quaternion, rigid

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

SCENE = "/move_group/monitored_planning_scene"


class PlanningRecorder(Recorder):
    """See the module. `scene` of a record, where it has changed: [[name, pose in the planning frame (16, by rows), x y
    z edges [m]]]."""

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._lock = threading.Lock()
        self._boxes, self._has_changed = {}, False
        self._subscriber = rospy.Subscriber(SCENE, PlanningScene, self._on_scene)

    def close(self) -> None:
        self._subscriber.unregister()
        super().close()

    def _more(self) -> dict[str, Any]:
        with self._lock:
            changed, self._has_changed = self._has_changed, False
            boxes = [[name, *box] for name, of_name in sorted(self._boxes.items()) for box in of_name]
        return {"scene": boxes} if changed else {}

    def _on_scene(self, message: Any) -> None:
        """A scene, or its changes."""
        with self._lock:
            if not message.is_diff:
                self._boxes = {}
            for thing in message.world.collision_objects:
                if thing.operation == CollisionObject.REMOVE:
                    self._boxes.pop(thing.id, None)
                elif thing.primitives:
                    self._boxes[thing.id] = _boxes(thing)
            self._has_changed = True


def _boxes(thing: Any) -> list[list[list[float]]]:
    """[pose (16), edges (3)] of the boxes of a CollisionObject."""
    return [[(_matrix(thing.pose) @ _matrix(pose)).ravel().round(5).tolist(), list(shape.dimensions)]
            for shape, pose in zip(thing.primitives, thing.primitive_poses, strict=False)
            if shape.type == SolidPrimitive.BOX]


def _matrix(pose: Pose) -> np.ndarray:
    at, turn = pose.position, pose.orientation
    quaternion = turn.x, turn.y, turn.z, turn.w
    return rigid(matrix_from_quaternion(quaternion) if any(quaternion) else np.eye(3), (at.x, at.y, at.z))
