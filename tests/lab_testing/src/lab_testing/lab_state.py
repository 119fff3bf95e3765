# SPDX-License-Identifier: BSD-3-Clause
"""The state of a running lab that tests share: read, compared with its first one, and put back between tests."""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import rosgraph
import rospy
from baxter_core_msgs.msg import AssemblyState
from controller_manager_msgs.srv import ListControllers
from gazebo_msgs.srv import DeleteModel, GetWorldProperties
from moveit_msgs.msg import PlanningScene, PlanningSceneComponents
from moveit_msgs.srv import ApplyPlanningScene, GetPlanningScene
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Empty

from lab_testing.waiting import wait_for_message, wait_until

# roslaunch's and the tests' own parameters, and the simulator's that follow from what happens.
OWN_PARAMETERS = ("/run_id", "/roslaunch")
# From the first posture to which a reset leads the joints [rad or m].
MAX_JOINT_ERROR = 0.02
RESET_DEADLINE_S = 30.0
# Connections and registrations of a program that has just ended go within this time.
GRACE_S = 15.0
ENABLE, ENABLED_STATE = "/robot/set_super_enable", "/robot/state"
FAKE_JOINT_STATES = "/move_group/fake_controller_joint_states"


@dataclass(frozen=True)
class LabState:
    """Things that a test may leave behind in a lab.

    graph: "kind name: node" of each registration; parameters: name -> value; models: of the world; controllers:
    "manager name: state"; scene: objects of move_group; joints: name -> position [rad or m]; enabled: the robot's, None
    where there is no such robot.
    """

    graph: frozenset[str]
    parameters: dict[str, Any] = field(default_factory=dict)
    models: frozenset[str] = frozenset()
    controllers: frozenset[str] = frozenset()
    scene: frozenset[str] = frozenset()
    joints: dict[str, float] = field(default_factory=dict)
    enabled: bool | None = None


def differences(first: LabState, now: LabState) -> list[str]:
    """Lines about what has come, gone or changed.

    The lab's own nodes may connect when they are first used, and stay so: only what new nodes have registered has come.
    """
    nodes = {node_of(row) for row in first.graph}
    found = [f"graph: {row} has come" for row in sorted(now.graph - first.graph) if node_of(row) not in nodes]
    found += [f"graph: {row} has gone" for row in sorted(first.graph - now.graph)]
    for kind in ("models", "controllers", "scene"):
        before, after = getattr(first, kind), getattr(now, kind)
        found += [f"{kind}: {name} has come" for name in sorted(after - before)]
        found += [f"{kind}: {name} has gone" for name in sorted(before - after)]
    for name in sorted({*first.parameters, *now.parameters}):
        before, after = (state.parameters.get(name) for state in (first, now))
        if before != after:
            found.append(f"parameters: {name} is {after!r}, was {before!r}")
    for name, position in first.joints.items():
        error = abs(now.joints.get(name, float("inf")) - position)
        if error > MAX_JOINT_ERROR:
            found.append(f"joints: {name} is {error:.3f} away from {position:.3f}")
    if first.enabled != now.enabled:
        found.append(f"enabled: {now.enabled}, was {first.enabled}")
    return found


def node_of(row: str) -> str:
    """The node of a row of :attr:`LabState.graph`."""
    return row.rpartition(": ")[2]


def flattened(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """(name, value) of each leaf of a parameter tree; an empty namespace is none."""
    if isinstance(value, dict):
        for key, below in value.items():
            yield from flattened(below, f"{name}/{key}")
    else:
        yield name, value


class Lab:
    """The lab on this process's master, of which the caller is a node. own: names of nodes that are not part of it."""

    def __init__(self, own: frozenset[str]):
        self._own = own
        self._master = rosgraph.Master(rospy.get_name())
        self._publishers: dict[str, rospy.Publisher] = {}

    def read(self) -> LabState:
        """Its state now. Raises rospy's and rosgraph's errors where the lab does not answer."""
        topics = {name for name, _ in self._master.getTopicTypes()}
        services = {name for name, _ in self._master.getSystemState()[2]}
        joints = "/joint_states" if "/joint_states" in topics else "/robot/joint_states"
        return LabState(
            self._graph(), self._parameters(), self._models(services), self._controllers(services),
            self._scene(services), self._positions(joints) if joints in topics else {},
            wait_for_message(ENABLED_STATE, AssemblyState).enabled if ENABLE in topics else None)

    def put_back(self, first: LabState) -> None:
        """Put parameters, world, scene, joints and the enabled state back to the first state.

        Raises AssertionError where the joints do not get there in time.
        """
        services = {name for name, _ in self._master.getSystemState()[2]}
        self._put_parameters_back(first.parameters)
        if "/gazebo/reset_world" in services:
            rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
            self._delete_models(self._models(services) - first.models)
            rospy.ServiceProxy("/gazebo/reset_world", Empty)()
        elif FAKE_JOINT_STATES in dict(self._master.getTopicTypes()):
            self._publish(FAKE_JOINT_STATES, JointState(name=list(first.joints), position=list(first.joints.values())))
        if "/apply_planning_scene" in services:
            self._empty_scene()
        if first.enabled is not None:
            self._publish(ENABLE, Bool(first.enabled))
        wait_until(lambda: not self.left(first, ("joints", "enabled")),
                   lambda: "; ".join(self.left(first, ("joints", "enabled"))), RESET_DEADLINE_S)

    def left(self, first: LabState, kinds: tuple[str, ...] = ()) -> list[str]:
        """:func:`differences` from the first state, of these kinds or of all."""
        return [line for line in differences(first, self.read()) if not kinds or line.startswith(kinds)]

    def _graph(self) -> frozenset[str]:
        found = set()
        for kind, rows in zip(("publisher", "subscriber", "service"), self._master.getSystemState(), strict=True):
            found |= {f"{kind} {name}: {node}" for name, nodes in rows for node in nodes if node not in self._own}
        return frozenset(found)

    def _parameters(self) -> dict[str, Any]:
        own = (*OWN_PARAMETERS, *self._own)
        return {name: value for name, value in flattened(self._master.getParam("/"))
                if not any(name == one or name.startswith(f"{one}/") for one in own)}

    def _put_parameters_back(self, first: dict[str, Any]) -> None:
        now = self._parameters()
        for name in now.keys() - first.keys():
            self._master.deleteParam(name)
        for name, value in first.items():
            if now.get(name) != value:
                self._master.setParam(name, value)

    def _models(self, services: set[str]) -> frozenset[str]:
        if "/gazebo/get_world_properties" not in services:
            return frozenset()
        return frozenset(rospy.ServiceProxy("/gazebo/get_world_properties", GetWorldProperties)().model_names)

    def _delete_models(self, names: frozenset[str]) -> None:
        for name in sorted(names):
            rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)(name)

    def _controllers(self, services: set[str]) -> frozenset[str]:
        found = set()
        for service in services:
            if service.endswith("/controller_manager/list_controllers"):
                for one in rospy.ServiceProxy(service, ListControllers)().controller:
                    found.add(f"{service.rpartition('/')[0]} {one.name}: {one.state}")
        return frozenset(found)

    def _scene(self, services: set[str]) -> frozenset[str]:
        if "/get_planning_scene" not in services:
            return frozenset()
        parts = PlanningSceneComponents.WORLD_OBJECT_NAMES | PlanningSceneComponents.ROBOT_STATE_ATTACHED_OBJECTS
        ask = rospy.ServiceProxy("/get_planning_scene", GetPlanningScene)
        scene = ask(PlanningSceneComponents(parts)).scene
        return frozenset([f"object {one.id}" for one in scene.world.collision_objects]
                         + [f"attached {one.object.id}" for one in scene.robot_state.attached_collision_objects])

    def _empty_scene(self) -> None:
        rospy.ServiceProxy("/apply_planning_scene", ApplyPlanningScene)(PlanningScene(is_diff=False))

    def _positions(self, topic: str) -> dict[str, float]:
        message = wait_for_message(topic, JointState, lambda one: bool(one.name))
        return dict(zip(message.name, message.position, strict=True))

    def _publish(self, topic: str, message: Any) -> None:
        publisher = self._publishers.get(topic) or rospy.Publisher(topic, type(message), queue_size=1)
        self._publishers[topic] = publisher
        wait_until(publisher.get_num_connections, f"a subscriber of {topic}")
        publisher.publish(message)
