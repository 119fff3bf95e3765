# SPDX-License-Identifier: BSD-3-Clause
"""``libgazebo_ros_vacuum_gripper.so``: attracts bodies near a link, and carries them along."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from std_msgs.msg import Bool
from std_srvs.srv import Empty, EmptyResponse

from bullet_sim import Pose
from gazebo_ros.sensor_plugins import PacedSensor

if TYPE_CHECKING:
    from collections.abc import Callable

    from std_srvs.srv import EmptyRequest

    from gazebo_ros.model_plugin import PluginContext

#: Distances between link frames [m] within which a body is attracted, and sticks.
REACH_M, STICKS_M = 0.05, 0.01
#: Largest pull [N]; it is 1 N m / distance.
MAX_N = 20.0


def pull(away: np.ndarray) -> np.ndarray:
    """The force (3,) [N] on something from which the gripper is ``away`` (3,) [m]."""
    distance = float(np.linalg.norm(away))
    return min(1.0 / distance, MAX_N) * away / distance if distance > 0.0 else np.zeros(3)


class VacuumGripper(PacedSensor):
    """Attracts links of other models within 5 cm of the link ``bodyName`` while it is on: services ``on`` and ``off``,
    std_msgs/Bool on ``topicName`` says whether it holds a body.

    Models that stand free move with the gripper, and within 1 cm they stick to it.
    """

    message_class = Bool

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._link = self.link_named("bodyName")
        self._is_on = self._holds = False
        self._services = [context.service(name, Empty, self._switch(on)) for name, on in (("on", True), ("off", False))]

    def update(self, time_s: float, dt: float) -> None:
        self._holds = self._is_on and self._draw()

    def publish(self, time_s: float) -> None:
        if self.is_due(time_s):
            self.publisher.publish(Bool(self._holds))

    def _draw(self) -> bool:
        """Pull at near links; returns whether there are any."""
        own = self.context.model
        place = np.asarray(own.link_pose(self._link).position)
        twist = own.link_twist(self._link)
        found = False
        for model in list(self.context.world.models.values()):
            if model is own or not model.free:
                continue
            for link in model.link_names:
                pose = model.link_pose(link)
                away = place - np.asarray(pose.position)
                distance = float(np.linalg.norm(away))
                if distance >= REACH_M:
                    continue
                found = True
                if link == model.robot.root and not model.static:
                    if distance < STICKS_M:
                        model.set_base_pose(Pose(tuple(place.tolist()), pose.quaternion))
                    model.set_base_twist(*twist)
                model.apply_wrench(link, pull(away).tolist())
        return found

    def _switch(self, on: bool) -> Callable[[EmptyRequest], EmptyResponse]:
        def handler(request):
            self._is_on = on
            return EmptyResponse()

        return handler

    def reset(self) -> None:
        super().reset()
        self._is_on = self._holds = False
