#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""ask_move_group.py NODE NAMESPACE: print facts about a move_group as one line of JSON. It is a separate process: it
needs ROS and the workspace's packages, and the doctor must work without them."""

import json
import sys
import time
from typing import Any

import rosgraph
import rospy
from moveit_msgs.msg import RobotState
from moveit_msgs.srv import GetStateValidity, GetStateValidityRequest
from sensor_msgs.msg import JointState

from motion_planning.model import PlanningModel
from moveit_ros_move_group.controllers import read_list

LISTEN_S = 2.0
JOINT_STATE = "sensor_msgs/JointState"
FAKE = "moveit_fake_controller_manager/MoveItFakeControllerManager"


def main() -> None:
    node, namespace = sys.argv[1:3]
    rospy.init_node("lab_doctor_planning", anonymous=True, disable_signals=True, disable_rostime=True)

    def parameter(name: str, usual: Any) -> Any:
        return rospy.get_param(f"{node}/{name}", usual)

    description = rospy.resolve_name(parameter("robot_description", "robot_description"), namespace + "x")
    model = PlanningModel.from_xml(rospy.get_param(description), rospy.get_param(description + "_semantic"))
    master = rosgraph.Master(rospy.get_name())
    publishers, subscribers, _ = master.getSystemState()
    publishers = dict(publishers)
    joint_topic = joint_topic_of(node, master, subscribers)
    entries, fake = parameter("controller_list", []), parameter("moveit_controller_manager", "") == FAKE
    controllers, _ = read_list(entries, fake)
    sensors = [sensor.get("point_cloud_topic") or sensor.get("image_topic") for sensor in parameter("sensors", []) or []
               if isinstance(sensor, dict)]
    sensors = [rospy.resolve_name(topic, node) for topic in sensors if topic]
    names, heard = listen(joint_topic, set(model.variables) - set(model.passive), sensors)
    validity = rospy.ServiceProxy(namespace + "check_state_validity", GetStateValidity)(
        GetStateValidityRequest(robot_state=RobotState(is_diff=True)))
    print(json.dumps({
        "node": node, "robot": model.name, "executes": bool(parameter("allow_trajectory_execution", True)),
        "groups": {name: list(group.joints) for name, group in model.groups.items()},
        "controllers": [{"action": one.action or one.name, "joints": list(one.joints), "remedy": one.remedy,
                         "answers": fake or bool(
            publishers.get(rospy.resolve_name(one.action + "/status", namespace + "x")))} for one in controllers],
        "joint_topic": joint_topic,
        "silent_joints": [name for name in model.variables if name not in names and name not in model.passive],
        "joints_out_of_bounds": [f"{name} is at {names[name]:.4f}, its limits are {low:.4f} and {high:.4f}"
                                 for name, (low, high), turns in zip(model.variables, model.bounds, model.continuous,
                                                                     strict=True)
                                 if name in names and not turns and not low - 1e-3 <= names[name] <= high + 1e-3],
        "contacts": sorted({(one.contact_body_1, one.contact_body_2) for one in validity.contacts}),
        "sensors": [{"topic": topic, "publishers": publishers.get(topic, []), "heard": topic in heard}
                    for topic in sensors],
    }), flush=True)
    rospy.signal_shutdown("done")


def joint_topic_of(node: str, master: rosgraph.Master, subscribers: list[tuple[str, list[str]]]) -> str:
    """The topic of joint states that a node subscribes to: it may have been remapped."""
    types = dict(master.getTopicTypes())
    found = [topic for topic, nodes in subscribers if node in nodes and types.get(topic) == JOINT_STATE]
    return found[0] if found else "/joint_states"


def listen(joint_topic: str, joints: set[str], sensors: list[str]) -> tuple[dict[str, float], set[str]]:
    """Return ({joint: position}, topics of sensors) of the messages within LISTEN_S; returns early once all have
    arrived."""
    names, heard = {}, set()
    kept = [rospy.Subscriber(joint_topic, JointState, lambda message: names.update(
        zip(message.name, message.position, strict=False)))]
    kept += [rospy.Subscriber(topic, rospy.AnyMsg, lambda _, topic=topic: heard.add(topic)) for topic in sensors]
    end = time.monotonic() + LISTEN_S
    while time.monotonic() < end and not (names.keys() >= joints and heard >= set(sensors)):
        time.sleep(0.02)
    for subscriber in kept:
        subscriber.unregister()
    return names, heard


if __name__ == "__main__":
    main()
