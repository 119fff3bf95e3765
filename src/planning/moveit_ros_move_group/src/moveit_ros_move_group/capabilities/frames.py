# SPDX-License-Identifier: BSD-3-Clause
"""The scene's objects and their subframes as frames on tf."""
from __future__ import annotations

import math
import threading
import time
from typing import TYPE_CHECKING, Any

import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from moveit_ros_move_group.convert.geometry import transform_of

if TYPE_CHECKING:
    from motion_planning.scene import Scene

# Rate of publishing [Hz], unless ~planning_scene_frame_publishing_rate says another.
_USUAL_HZ = 10.0


def scene_frames(scene: Scene, prefix: str, stamp: rospy.Time) -> list[TransformStamped]:
    """The frames of a Scene's objects, those that the robot holds in their links, and of all their subframes."""
    things = [(thing, scene.model.frame) for thing in scene.objects.values()]
    things += [(body.object, body.link) for body in scene.state.attached.values()]
    frames = []
    for thing, parent in things:
        name = prefix + thing.id
        for child, frame, pose in ((name, parent, thing.pose),
                                   *((f"{name}/{one}", name, pose) for one, pose in thing.subframes.items())):
            entry = TransformStamped(child_frame_id=child, transform=transform_of(pose))
            entry.header.frame_id, entry.header.stamp = frame, stamp
            frames.append(entry)
    return frames


class TfPublisher:
    """Publishes them on ``/tf``, named ``~planning_scene_tf_prefix`` (``move_group/``) and the object's id."""

    def __init__(self, context: Any) -> None:
        self.context = context
        hz = rospy.get_param("~planning_scene_frame_publishing_rate", _USUAL_HZ)
        self._hz = hz if isinstance(hz, (int, float)) and 0.0 < hz < math.inf else _USUAL_HZ
        # tf's names have no slash in front.
        self._prefix = str(rospy.get_param("~planning_scene_tf_prefix", rospy.get_name() + "/")).lstrip("/")
        self._publisher = rospy.Publisher("/tf", TFMessage, queue_size=100)
        self._newest = rospy.Time()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            time.sleep(1.0 / self._hz)
            try:
                self.publish()
            except Exception as error:  # the next scene may be publishable
                if not rospy.is_shutdown():
                    rospy.logerr_throttle(30.0, "the scene's frames could not be published: %s: %s"
                                          % (type(error).__name__, error))

    def publish(self) -> None:
        """Publish the frames as they are now, once for each time of a clock that may stand."""
        stamp = rospy.Time.now()
        if stamp == self._newest:
            return
        self._newest = stamp
        frames = scene_frames(self.context.monitor.scene(), self._prefix, stamp)
        if frames:
            self._publisher.publish(TFMessage(frames))
