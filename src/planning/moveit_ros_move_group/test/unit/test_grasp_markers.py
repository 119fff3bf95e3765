# SPDX-License-Identifier: BSD-3-Clause
"""The hand is drawn where each grasp would close it."""
from types import SimpleNamespace

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from motion_planning.manipulation import Candidate, Fall, Translation
from motion_planning.model import PlanningModel
from motion_planning.scene import Scene
from moveit_ros_move_group.grasp_markers import FELL, UNTRIED, WORKS, hands

URDF = """<robot name="post"><link name="base"/>
  <link name="palm"><visual><origin xyz="0 0 0.1"/><geometry><mesh filename="package://hand/palm.dae" scale="2 2 2"/>
  </geometry></visual></link>
  <link name="finger"><visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>
  <joint name="turn" type="revolute"><origin xyz="0 0 0.5"/><parent link="base"/><child link="palm"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="open" type="prismatic"><parent link="palm"/><child link="finger"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.04" effort="1" velocity="1"/></joint></robot>"""
SRDF = """<robot name="post"><virtual_joint name="world_joint" type="fixed" parent_frame="world" child_link="base"/>
  <group name="arm"><joint name="turn"/></group></robot>"""


def candidate(name, x):
    pose = np.eye(4)
    pose[0, 3] = x
    nowhere = Translation(np.array((0.0, 0.0, 1.0)))
    return Candidate(name, pose, nowhere, nowhere, before={"open": 1.0})


def test_each_hand_stands_where_its_grasp_is_in_the_colour_of_what_became_of_it():
    model = PlanningModel.from_xml(URDF, SRDF)
    candidates = [candidate("far", 3.0), candidate("top", 0.4), candidate("side", 0.5)]
    job = SimpleNamespace(task=SimpleNamespace(scene=Scene(model), link="palm"), hand={"palm", "finger"},
                          candidates=candidates)
    first, *markers = hands(job, candidates[1], [Fall("far", "grasp pose", "out of reach", -1)]).markers
    assert first.action == Marker.DELETEALL and all(one.header.frame_id == model.frame for one in (first, *markers))
    for name, x, colour in (("far", 3.0, FELL), ("top", 0.4, WORKS), ("side", 0.5, UNTRIED)):
        finger, palm = (one for one in markers if one.ns == name)
        assert palm.mesh_resource == "package://hand/palm.dae" and palm.scale.x == 2.0
        assert (palm.pose.position.x, palm.pose.position.z) == pytest.approx((x, 0.1))
        # The finger is as far out as it goes: the posture says 1 m, its limit 0.04.
        assert (finger.type, finger.scale.z) == (Marker.CUBE, 0.3)
        assert finger.pose.position.x == pytest.approx(x + 0.04)
        assert (palm.color.r, palm.color.g, palm.color.b, palm.color.a) == colour
    nobody = hands(job, None, []).markers[1:]
    assert {(one.color.r, one.color.g) for one in nobody} == {UNTRIED[:2]}
