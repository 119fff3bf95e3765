# SPDX-License-Identifier: BSD-3-Clause
"""A belt that carries by friction."""
import numpy as np
import pytest
from std_msgs.msg import Float64

from bullet_sim import Pose
from gazebo_plugins.conveyor import ConveyorBelt
from gazebo_ros.model_plugin import PluginError
from urdf_model import parse_urdf

BELT = """<robot name="belt"><link name="world"/>
<link name="surface"><inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="3 0.4 0.1"/></geometry></collision></link>
<joint name="slide" type="prismatic"><parent link="world"/><child link="surface"/><origin xyz="0 0 0.5"/>
<axis xyz="1 0 0"/><limit lower="-0.01" upper="0.01" effort="100" velocity="2"/></joint>%s</robot>"""
BLOCK = """<robot name="block"><link name="link"><inertial><mass value="0.1"/>
<inertia ixx="4e-5" iyy="4e-5" izz="4e-5" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.05 0.05 0.05"/></geometry></collision></link></robot>"""


def place(lab):
    return np.asarray(lab.world.models["block"].link_pose("link").position)


@pytest.fixture
def lab(make):
    made = make(BELT, ConveyorBelt, {"joint": "slide", "speed": 0.2})
    made.world.spawn(parse_urdf(BLOCK), "block", Pose((0.0, 0.0, 0.576)))
    return made


def test_a_block_rides_at_the_speed_of_the_belt(lab):
    lab.run(0.5)
    before = place(lab)
    after = place(lab.run(2.0))
    assert after[0] - before[0] == pytest.approx(0.4, abs=0.004)
    assert after[1:] == pytest.approx([0.0, 0.575], abs=0.003)
    assert abs(lab.model.read_joints()[0][0]) < 0.001, "the belt itself stays where it is"


def test_a_command_stops_and_turns_it(lab):
    lab.run(0.5)
    commands = lab.ros.subscriptions["/ns/conveyor/command"]
    for speed, wrong in ((0.0, None), (-0.3, 1e9), (-0.3, float("nan"))):
        commands.put(Float64(speed))
        before = place(lab.run(0.3))
        if wrong is not None:
            commands.put(Float64(wrong))
        assert place(lab.run(1.0))[0] - before[0] == pytest.approx(speed, abs=0.004)
    assert len(lab.log.of("warn")) == 2 and "expected -2 to 2 m/s" in lab.log.of("warn")[0]


def test_an_unknown_joint_and_a_wrong_speed_are_named(make):
    with pytest.raises(PluginError, match="<joint> is 'x', expected one of the prismatic joints slide"):
        make(BELT, ConveyorBelt, {"joint": "x"})
    with pytest.raises(PluginError, match="<speed> is 'fast', expected -2 to 2 m/s"):
        make(BELT, ConveyorBelt, {"joint": "slide", "speed": "fast"})
