# SPDX-License-Identifier: BSD-3-Clause
"""Objects of the scene are frames on tf where the capability for it is asked for."""
from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject
from shape_msgs.msg import SolidPrimitive

from moveit_ros_move_group.capabilities import frames

sys.path.insert(0, str(Path(__file__).parents[1]))
from in_process import Node  # noqa: E402
from small_arm import joint_state, parameters  # noqa: E402

UPRIGHT = Quaternion(0.0, 0.0, 0.0, 1.0)


def thing(name, frame, x, subframe_x):
    message = CollisionObject(id=name, pose=Pose(Point(x, 0.0, 0.0), UPRIGHT), operation=CollisionObject.ADD,
                              primitives=[SolidPrimitive(SolidPrimitive.SPHERE, [0.01])],
                              primitive_poses=[Pose(Point(), UPRIGHT)], subframe_names=["top"],
                              subframe_poses=[Pose(Point(subframe_x, 0.0, 0.0), UPRIGHT)])
    message.header.frame_id = frame
    return message


def published(monkeypatch, **private):
    """tf as it is after the node has published its frames once."""
    # Its thread publishes at a rate; here the test publishes once.
    monkeypatch.setattr(frames, "threading", SimpleNamespace(Thread=lambda **_: SimpleNamespace(start=lambda: None)))
    monkeypatch.setattr(rospy, "get_name", lambda: "/move_group")
    tree = parameters()
    tree["~"] = {**tree["~"], **private}
    node = Node(monkeypatch, tree)
    node.topics["joint_states"](joint_state())
    node.topics["collision_object"](thing("crate", "base", 1.0, 0.2))
    node.topics["attached_collision_object"](
        AttachedCollisionObject(link_name="l5", object=thing("tool", "l5", 0.1, 0.05)))
    for one in node.kept:
        if isinstance(one, frames.TfPublisher):
            one.publish()
    buffer = tf2_ros.BufferCore()
    for message in node.told("/tf"):
        for frame in message.transforms:
            buffer.set_transform(frame, "test")
    return buffer


def x_of(buffer, parent, child):
    return buffer.lookup_transform_core(parent, child, rospy.Time()).transform.translation.x


def test_objects_in_the_world_and_in_the_hand_with_their_subframes(monkeypatch):
    buffer = published(monkeypatch, capabilities="move_group/TfPublisher")
    assert x_of(buffer, "base", "move_group/crate") == pytest.approx(1.0)
    assert x_of(buffer, "base", "move_group/crate/top") == pytest.approx(1.2)
    assert x_of(buffer, "l5", "move_group/tool") == pytest.approx(0.1)
    assert x_of(buffer, "l5", "move_group/tool/top") == pytest.approx(0.15)


def test_another_prefix(monkeypatch):
    buffer = published(monkeypatch, capabilities="move_group/TfPublisher", planning_scene_tf_prefix="/scene_")
    assert x_of(buffer, "base", "scene_crate/top") == pytest.approx(1.2)


def test_no_frames_unless_asked_for(monkeypatch):
    assert published(monkeypatch).all_frames_as_yaml() == "{}"
