# SPDX-License-Identifier: BSD-3-Clause
"""A joint that mimics another one."""
import numpy as np
import pytest

from gazebo_plugins.mimic_joint import MimicJoint
from gazebo_ros.model_plugin import PluginError

INERTIA = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
FINGER = """<link name="%(name)s_link">%(body)s</link><joint name="%(name)s" type="revolute"><parent link="base"/>
<child link="%(name)s_link"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="5"/></joint>"""
GRIPPER = '<robot name="g"><link name="world"/><link name="base">%s</link><joint name="j" type="fixed">' \
    '<parent link="world"/><child link="base"/></joint>%s%%s</robot>' % (
        INERTIA, "".join(FINGER % {"name": name, "body": INERTIA} for name in ("left", "right")))
LEFT, RIGHT = 0, 1


@pytest.mark.parametrize("force", [{}, {"hasPID": "", "maxEffort": 5}])
def test_it_follows_with_multiplier_and_offset(make, force):
    elements = {"joint": "left", "mimicJoint": "right", "multiplier": -0.5, "offset": 0.1, **force}
    lab = make(GRIPPER, MimicJoint, elements)
    lab.run(1.0, lambda: lab.model.drive_position(np.array([LEFT]), np.array([0.6]), np.array([10.0])))
    position = lab.model.read_joints()[0]
    assert position[LEFT] == pytest.approx(0.6, abs=0.01)
    assert position[RIGHT] == pytest.approx(-0.5 * position[LEFT] + 0.1, abs=0.005)


def test_small_differences_are_left_alone(make):
    lab = make(GRIPPER, MimicJoint, {"joint": "left", "mimicJoint": "right", "offset": 0.1, "sensitiveness": 0.2})
    assert abs(lab.run(0.1).model.read_joints()[0][RIGHT]) < 0.01


def test_an_unknown_joint_and_a_wrong_number_are_named(make):
    with pytest.raises(PluginError, match="<mimicJoint> is 'thumb', expected one of the joints left, right"):
        make(GRIPPER, MimicJoint, {"joint": "left", "mimicJoint": "thumb"})
    with pytest.raises(PluginError, match="<multiplier> is 'twice'"):
        make(GRIPPER, MimicJoint, {"joint": "left", "mimicJoint": "right", "multiplier": "twice"})
