# SPDX-License-Identifier: BSD-3-Clause
"""Calls every compiled function once."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.model import PlanningModel
from motion_planning.scene import Scene, WorldObject
from motion_planning.spheres import SphereModel
from moveit_servo.servo import Servo, ServoCommand
from moveit_servo.settings import ServoSettings
from moveit_servo.straight import StraightWay
from moveit_servo.surroundings import Surroundings
from urdf_model import Box

if TYPE_CHECKING:
    from motion_planning.shapes import TriangleMesh

_URDF = """<robot name="small"><link name="base"/><link name="arm">
<collision><geometry><box size="0.4 0.05 0.05"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
_SRDF = """<robot name="small"><group name="arm"><chain base_link="base" tip_link="arm"/></group></robot>"""


def warm_up() -> None:
    """Compile all, or load it from the cache."""
    model = PlanningModel.from_xml(_URDF, _SRDF)
    servo = Servo(model, ServoSettings(move_group_name="arm", command_out_topic="command"))
    scene = Scene(model).with_object(WorldObject("box", np.eye(4), ((Box((0.1, 0.9, 0.1)), np.eye(4)),)))
    no_meshes: dict[str, TriangleMesh] = {}
    servo.surroundings = Surroundings(SphereModel.of(model, no_meshes.__getitem__), servo.group, scene)
    turn = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])
    for command in (ServoCommand(joints=np.array([0.5])), ServoCommand(twist=turn), ServoCommand(pose=np.eye(4))):
        servo.step(np.zeros(1), np.zeros(1), command, 0.01)
    # A servo calls it for a hand that has come up to the speed of its twist and that nothing holds back.
    way = StraightWay()
    for _ in range(2):
        way.correction(servo.pose(np.zeros(1)), turn, 1.0)
