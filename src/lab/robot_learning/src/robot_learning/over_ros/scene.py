# SPDX-License-Identifier: BSD-3-Clause
"""The things of a task on a ROS master, with the members of `baxter_lab.Lab` that tasks use: put up in the simulator,
where /gazebo/model_states has their poses. With a physical robot, a program that sees them publishes them there."""
from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import rospy
from gazebo_msgs.msg import ModelState, ModelStates
from gazebo_msgs.srv import GetModelState, GetWorldProperties, SetModelState, SpawnModel
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage

from baxter_model import BASE_HEIGHT_M
from bullet_sim import Pose
from gazebo_ros.gazebo_interface import GazeboInterfaceError, call

from .robot import RosRobot

_GAZEBO = "/gazebo"


def box_urdf(name: str, size: tuple[float, ...], mass_kg: float | None, friction: float | None) -> str:
    """A box as URDF; without a mass it is fixed to the world."""
    robot = ElementTree.Element("robot", name=name)
    link_name = "link" if mass_kg is not None else "world"
    link = ElementTree.SubElement(robot, "link", name=link_name)
    for tag in ("visual", "collision"):
        geometry = ElementTree.SubElement(ElementTree.SubElement(link, tag), "geometry")
        ElementTree.SubElement(geometry, "box", size="%r %r %r" % tuple(map(float, size)))
    if mass_kg is not None:
        x, y, z = (side * side for side in size)
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "mass", value=repr(float(mass_kg)))
        ElementTree.SubElement(inertial, "inertia", ixx=repr(mass_kg * (y + z) / 12), iyy=repr(mass_kg * (x + z) / 12),
                               izz=repr(mass_kg * (x + y) / 12), ixy="0", ixz="0", iyz="0")
    if friction is not None:
        surface = ElementTree.SubElement(robot, "gazebo", reference=link_name)
        for name_of in ("mu1", "mu2"):
            ElementTree.SubElement(surface, name_of).text = repr(float(friction))
    return ElementTree.tostring(robot, encoding="unicode")


class RosThing:
    """A thing in the world; places are in `base`."""

    def __init__(self, name: str, scene: RosLab):
        self.name, self._scene, self.model = name, scene, self

    def base_pose(self) -> Pose:
        """Where it is."""
        return self._scene.pose_of(self.name)

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) where it is."""
        return self.base_pose().matrix()

    @property
    def position(self) -> np.ndarray:
        """(3,) [m]."""
        return np.array(self.base_pose().position)

    def put(self, place: tuple[float, ...], yaw: float = 0.0) -> None:
        """Put it at (x, y, z) [m], turned about the vertical, at rest. Raises GazeboInterfaceError."""
        state = ModelState(model_name=self.name, pose=_message(place, yaw), reference_frame="world")
        answer = call(_GAZEBO + "/set_model_state", SetModelState, state)
        if not answer.success:
            raise GazeboInterfaceError("model '%s' cannot be moved: %s" % (self.name, answer.status_message))


class RosLab:
    """The tasks' view of a lab: `robot`, and things, which are put up unless they are there or no simulator is. Raises
    GazeboInterfaceError."""

    def __init__(self, robot: RosRobot):
        self.robot, self._poses, self._names, self._asks = robot, {}, [], False
        self.seen: float | None = None
        try:
            self._there = set(call(_GAZEBO + "/get_world_properties", GetWorldProperties).model_names)
        except GazeboInterfaceError as error:
            self._there = None
            rospy.logwarn("nothing is put up, since there is no simulator (%s); the things must be on "
                          "/gazebo/model_states", error)
        self._kept = rospy.Subscriber(_GAZEBO + "/model_states", ModelStates, self._on_states, queue_size=1,
                                      tcp_nodelay=True)

    def _on_states(self, message: ModelStates) -> None:
        if not self._asks:
            self._poses = dict(zip(message.name, message.pose, strict=True))
        self.seen = rospy.get_time()

    def look(self) -> None:
        """Ask the simulator where the things are now: what comes on the topic is older. From then on only this counts.
        Raises GazeboInterfaceError."""
        self._asks = True
        for name in self._names:
            answer = call(_GAZEBO + "/get_model_state", GetModelState, name, "world")
            if not answer.success:
                raise GazeboInterfaceError("model '%s' is not seen: %s" % (name, answer.status_message))
            self._poses[name] = answer.pose

    def pose_of(self, name: str) -> Pose:
        """Raises GazeboInterfaceError where nothing of that name is seen."""
        if name not in self._poses:
            raise GazeboInterfaceError("%s/model_states has no '%s'; it has %s" % (
                _GAZEBO, name, ", ".join(self._poses) or "nothing"))
        place, turn = self._poses[name].position, self._poses[name].orientation
        return Pose((place.x, place.y, place.z - BASE_HEIGHT_M), (turn.x, turn.y, turn.z, turn.w))

    def add_box(self, name: str, size: tuple[float, ...], place: tuple[float, ...], yaw: float = 0.0,
                mass_kg: float | None = None, friction: float | None = None, **_: object) -> RosThing:
        """As `baxter_lab.Lab.add_box`; colours are left out."""
        return self.add_urdf(name, box_urdf(name, size, mass_kg, friction), place, yaw)

    def add_urdf(self, name: str, description: str, place: tuple[float, ...], yaw: float = 0.0) -> RosThing:
        """As `baxter_lab.Lab.add_urdf`, of a text."""
        if self._there is not None and name not in self._there:
            answer = call(_GAZEBO + "/spawn_urdf_model", SpawnModel, name, description, "/", _message(place, yaw),
                          "world")
            if not answer.success:
                raise GazeboInterfaceError("model '%s' cannot be spawned: %s" % (name, answer.status_message))
        self._names.append(name)
        return RosThing(name, self)


def _message(place, yaw):
    x, y, z = map(float, place)
    return PoseMessage(Point(x, y, z + BASE_HEIGHT_M), Quaternion(0.0, 0.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0)))
