# SPDX-License-Identifier: BSD-3-Clause
"""The electric gripper: which commands it takes, and what its fingers make of them in a physics world."""
import pytest
from baxter_core_msgs.msg import EndEffectorCommand

import xacro
from baxter_sim_hardware import CommandRefused
from baxter_sim_hardware.gripper import PARAMETERS, ElectricGripper
from bullet_sim import Pose
from urdf_model import parse_urdf

SIDES = ("left", "right")
BOX = """<robot name="box"><link name="box">
  <collision><geometry><box size="%g %g %g"/></geometry></collision>
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def state(lab, side="left"):
    return lab.last("end_effector/%s_gripper/state" % side)


def tell(lab, command, args="", sender="", sequence=0, side="left", seconds=0.02):
    lab.send("end_effector/%s_gripper/command" % side, EndEffectorCommand(65538, command, args, sender, sequence))
    lab.run(seconds)
    return state(lab, side)


def take(gripper, command, args="", enabled=True):
    gripper.take(command, args, "", 0, 1.0, enabled)


@pytest.mark.parametrize("command, args, text", [
    ("dance", "", "unknown gripper command 'dance'; choices are no_op, set, configure"),
    ("go", "", 'go needs {"position": 0 to 100}, not {}'),
    ("go", '{"position": "wide"}', "go needs"),
    ("go", '{"position": NaN}', "go needs"),
    ("go", "{'position': 3}", "must be a JSON object"),
    ("go", "[3]", "must be a JSON object"),
    ("configure", '{"velocity": 101}', "velocity is 101; parameters are velocity, moving_force"),
    ("configure", '{"speed": 1}', "speed is 1; parameters are"),
])
def test_senseless_commands_are_refused(command, args, text):
    gripper = ElectricGripper(0.02, 1.0)
    with pytest.raises(CommandRefused) as refusal:
        take(gripper, command, args)
    assert text in str(refusal.value)
    assert gripper.parameters == PARAMETERS


@pytest.mark.parametrize("command, args", [("go", '{"position": 0}'), ("grip", ""), ("release", ""), ("calibrate", "")])
def test_disabled_robot_moves_no_finger(command, args):
    with pytest.raises(CommandRefused, match="disabled"):
        take(ElectricGripper(0.02, 1.0), command, args, enabled=False)


@pytest.mark.parametrize("side", SIDES)
def test_properties_and_first_state(make_lab, side):
    lab = make_lab()
    lab.run(0.1)
    properties = lab.last("end_effector/%s_gripper/properties" % side)
    assert (properties.id, properties.ui_type, properties.product) == (65538, 2, "SDK End Effector")
    assert properties.firmware_date == "2014/7/24 18:30:00"
    first = state(lab, side)
    assert (first.id, first.calibrated, first.ready, first.moving, first.gripping, first.missed, first.error) == (
        65538, 1, 1, 0, 0, 0, 0)
    assert first.position == pytest.approx(100.0, abs=0.5)


@pytest.mark.parametrize("percent", [0.0, 37.5, 50.0, 100.0])
def test_go_reaches_its_percentage(lab, percent):
    tell(lab, "go", '{"position": 60}', seconds=1.0)
    tell(lab, "go", '{"position": %g}' % percent, "me_go", 7, seconds=1.5)
    now = state(lab)
    assert now.position == pytest.approx(percent, abs=1.0)
    assert (now.moving, now.gripping, now.missed) == (0, 0, int(percent == 0.0))
    assert (now.command, now.command_sender, now.command_sequence) == ("go", "me_go", 7)
    assert state(lab, "right").position == pytest.approx(100.0, abs=0.5)


def test_moving_while_it_moves_and_stop_in_between(lab):
    assert tell(lab, "go", '{"position": 0}', seconds=0.2).moving == 1
    stopped = tell(lab, "stop", seconds=0.3)
    assert stopped.moving == 0
    assert 20.0 < stopped.position < 90.0
    lab.run(0.5)
    assert state(lab).position == pytest.approx(stopped.position, abs=0.5)


def test_velocity_parameter(lab):
    tell(lab, "configure", '{"velocity": 10.0}')
    assert tell(lab, "go", '{"position": 0}', seconds=1.0).position == pytest.approx(52.0, abs=4.0)


def test_calibration_comes_back_and_a_repeated_command_is_the_same_one(lab):
    assert tell(lab, "clear_calibration").calibrated == 0
    tell(lab, "go", '{"position": 0}')
    assert "not calibrated" in lab.log.lines[-1]
    assert state(lab).position == pytest.approx(100.0, abs=0.5)
    for _ in range(20):
        tell(lab, "calibrate", "", "me_calibrate", 3, seconds=0.1)
    assert state(lab).calibrated == 1
    assert tell(lab, "calibrate", "", "me_calibrate", 3).calibrated == 1
    assert state(lab).position == pytest.approx(100.0, abs=1.0)
    assert tell(lab, "reboot", "", "me_reboot", 4).calibrated == 0


def test_holds_what_is_between_its_fingers_and_notices_when_it_is_gone(lab):
    tip = lab.model.link_pose("left_gripper")
    box = parse_urdf(BOX % (0.03, 0.05, 0.04), source="box")
    lab.world.spawn(box, "box", Pose(tip.position, tip.quaternion), static=True)
    tell(lab, "go", '{"position": 0}', seconds=1.5)
    held = state(lab)
    assert (held.gripping, held.moving, held.missed) == (1, 0, 0)
    assert 5.0 < held.position < 100.0
    assert held.force == pytest.approx(30.0, abs=5.0)
    lab.world.delete("box")
    lab.run(1.5)
    free = state(lab)
    assert (free.gripping, free.moving, free.missed) == (0, 0, 1)
    assert free.position == pytest.approx(0.0, abs=1.0)


def test_an_arm_without_a_gripper_says_so(make_lab, bare_robot):
    lab = make_lab(model=bare_robot)
    lab.run(0.1)
    for side in SIDES:
        assert lab.last("end_effector/%s_gripper/properties" % side).ui_type == 0
        assert state(lab, side).gripping == 2
    tell(lab, "go", '{"position": 0}')
    assert "the left arm carries no gripper" in lab.log.lines[-1]


@pytest.fixture(scope="session")
def bare_robot(robot_file):
    without = {"%s_electric_gripper" % side: "false" for side in SIDES}
    return parse_urdf(xacro.process_file(robot_file, mappings=without).toxml(), source=robot_file)
