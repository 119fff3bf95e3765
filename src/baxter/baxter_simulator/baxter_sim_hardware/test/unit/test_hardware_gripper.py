# SPDX-License-Identifier: BSD-3-Clause
"""The electric gripper: which commands it takes, and how its fingers move in a physics world."""
import json

import numpy as np
import pytest
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorProperties, EndEffectorState

import xacro
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.grippers.commands import CustomGripperHardware
from baxter_sim_hardware.grippers.electric import ElectricGripperHardware
from bullet_sim import Pose
from urdf_model import parse_urdf

HEARD = ("end_effector/*",)

SIDES = ("left", "right")
BOX = """<robot name="box"><link name="box">
  <collision><geometry><box size="%g %g %g"/></geometry></collision>
  <inertial><mass value="0.3"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  </link></robot>"""


def state(lab, side="left"):
    return lab.last("end_effector/%s_gripper/state" % side)


def tell(lab, command, args="", sender="", sequence=0, side="left", seconds=0.02):
    lab.send("end_effector/%s_gripper/command" % side, EndEffectorCommand(65538, command, args, sender, sequence))
    lab.run(seconds)
    return state(lab, side)


def take(gripper, command, args="", enabled=True):
    gripper.take(command, args, "", 0, enabled)


@pytest.mark.parametrize("command, args, text", [
    ("dance", "", "unknown gripper command 'dance'; choices are no_op, set, configure"),
    ("go", "", 'go needs {"position": 0 to 100}, not {}'),
    ("go", '{"position": "wide"}', "go needs"),
    ("go", '{"position": NaN}', "go needs"),
    ("go", "{'position': 3}", "must be a JSON object"),
    ("go", "[3]", "must be a JSON object"),
    ("configure", '{"velocity": 101}', "velocity is 101; parameters are velocity (0 to 100), moving_force"),
    ("configure", '{"speed": 1}', "speed is 1; parameters are"),
])
def test_senseless_commands_are_refused(command, args, text):
    gripper = ElectricGripperHardware(0.02, 1.0)
    with pytest.raises(CommandRefused) as refusal:
        take(gripper, command, args)
    assert text in str(refusal.value)
    assert gripper.parameters == {"velocity": 50.0, "moving_force": 40.0, "holding_force": 30.0, "dead_zone": 5.0}


@pytest.mark.parametrize("command, args", [("go", '{"position": 0}'), ("grip", ""), ("release", ""), ("calibrate", "")])
def test_disabled_robot_moves_no_finger(command, args):
    with pytest.raises(CommandRefused, match="not enabled"):
        take(ElectricGripperHardware(0.02, 1.0), command, args, enabled=False)


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


def test_a_stop_that_a_client_repeats_until_the_fingers_stand(lab):
    tell(lab, "go", '{"position": 0}', seconds=0.2)
    for _ in range(30):
        stopped = tell(lab, "stop", sender="me_stop", sequence=3, seconds=0.01)
    assert stopped.moving == 0
    assert 20.0 < stopped.position < 90.0
    for _ in range(10):
        assert tell(lab, "stop", sender="me_stop", sequence=3, seconds=0.01).moving == 0


def test_velocity_parameter(lab):
    tell(lab, "configure", '{"velocity": 10.0}')
    assert tell(lab, "go", '{"position": 0}', seconds=1.0).position == pytest.approx(52.0, abs=4.0)


def test_calibration_comes_back_and_a_repeated_command_is_the_same_one(lab):
    assert tell(lab, "clear_calibration").calibrated == 0
    tell(lab, "go", '{"position": 0}')
    assert "not calibrated" in lab.log.lines[-1]
    assert state(lab).position == pytest.approx(100.0, abs=0.5)
    assert tell(lab, "calibrate", "", "me_calibrate", 3, seconds=0.1).ready == 0
    for _ in range(20):
        tell(lab, "calibrate", "", "me_calibrate", 3, seconds=0.1)
    assert (state(lab).calibrated, state(lab).ready, state(lab).error) == (1, 1, 0)
    assert tell(lab, "calibrate", "", "me_calibrate", 3).calibrated == 1
    assert state(lab).position == pytest.approx(100.0, abs=1.0)
    assert tell(lab, "reboot", "", "me_reboot", 4).calibrated == 0


def test_a_calibration_of_a_disabled_robot_leaves_the_gripper_as_it_was(lab):
    lab.enable(False)
    assert tell(lab, "clear_calibration").calibrated == 1  # clients clear first, then calibrate
    assert tell(lab, "calibrate").calibrated == 1
    assert any("not enabled" in line for line in lab.log.lines)
    lab.enable()
    assert tell(lab, "go", '{"position": 0}', seconds=1.5).position == pytest.approx(0.0, abs=1.0)


def test_calibration_that_does_not_find_the_ends_is_an_error_until_reset(lab):
    put_box_between_fingers(lab)
    tell(lab, "calibrate", seconds=2.0)
    failed = state(lab)
    assert (failed.calibrated, failed.error, failed.ready, failed.moving) == (0, 1, 0, 0)
    assert tell(lab, "reset").error == 0
    assert (state(lab).calibrated, state(lab).ready) == (0, 1)
    lab.world.delete("box")
    tell(lab, "calibrate", seconds=2.0)
    assert (state(lab).calibrated, state(lab).error) == (1, 0)


def test_disabling_ends_a_calibration_and_a_move_but_not_a_grip(lab):
    tell(lab, "calibrate", seconds=0.1)
    lab.enable(False)
    lab.run(1.0)
    assert (state(lab).calibrated, state(lab).ready, state(lab).moving, state(lab).enabled) == (0, 1, 0, 0)
    lab.enable()
    tell(lab, "calibrate", seconds=2.0)
    box = hold_box(lab)
    lab.enable(False)
    lab.run(1.0)
    assert (state(lab).gripping, state(lab).moving) == (1, 0)
    assert box.base_pose().position[2] == pytest.approx(lab.model.link_pose("left_gripper").position[2], abs=0.005)


def put_box_between_fingers(lab, static=True):
    tip = lab.model.link_pose("left_gripper")
    box = parse_urdf(BOX % (0.03, 0.04, 0.04), source="box")
    return lab.world.spawn(box, "box", Pose(tip.position, tip.quaternion), static=static)


def hold_box(lab, static=False):
    """Put a box between the fingers and close them; gravity on it starts then."""
    lab.world.set_gravity((0.0, 0.0, 0.0))
    box = put_box_between_fingers(lab, static)
    tell(lab, "go", '{"position": 0}', seconds=1.0)
    lab.world.set_gravity((0.0, 0.0, -9.81))
    lab.run(0.5)
    return box


@pytest.mark.parametrize("static", [True, False])
def test_holds_what_is_between_its_fingers_and_notices_when_it_is_gone(lab, static):
    hold_box(lab, static)
    held = state(lab)
    assert (held.gripping, held.moving, held.missed) == (1, 0, 0)
    assert held.position == pytest.approx(57.6, abs=2.0)  # 40 mm, of a gap of 16 to 57.7 mm
    assert held.force == pytest.approx(30.0, abs=2.0)
    lab.world.delete("box")
    lab.run(1.5)
    free = state(lab)
    assert (free.gripping, free.moving, free.missed) == (0, 0, 1)
    assert free.force == 0.0
    assert free.position == pytest.approx(0.0, abs=1.0)


def test_holds_from_inside_what_stands_around_its_fingers(lab):
    tell(lab, "go", '{"position": 0}', seconds=1.0)
    tip = lab.model.link_pose("left_gripper").matrix()
    wall = parse_urdf(BOX % (0.03, 0.02, 0.04), source="wall")
    for name, sign in (("here", 1.0), ("there", -1.0)):
        place = tip[:3, 3] + sign * 0.045 * tip[:3, 1]  # its near face 35 mm from the middle
        lab.world.spawn(wall, name, Pose(tuple(place), lab.model.link_pose("left_gripper").quaternion), static=True)
    tell(lab, "go", '{"position": 100}', seconds=1.0)
    held = state(lab)
    assert (held.gripping, held.moving) == (1, 0)
    assert 20.0 < held.position < 95.0
    assert held.force == pytest.approx(30.0, abs=2.0)


@pytest.mark.parametrize("held", [False, True])
def test_the_hands_pose_is_looked_up_only_while_the_fingers_touch_something(lab, monkeypatch, held):
    if held:
        hold_box(lab)
    looked, link_pose = [], lab.model.link_pose
    monkeypatch.setattr(lab.model, "link_pose", lambda link: looked.append(link) or link_pose(link))
    lab.run(0.2)
    assert ("left_gripper" in looked) is held
    assert (state(lab).force > 1.0) is held


def test_flags_stay_while_something_is_held(lab):
    hold_box(lab)
    seen = lab.publishers["end_effector/left_gripper/state"].messages
    del seen[:]
    lab.run(2.0)
    assert {(message.gripping, message.moving, message.missed) for message in seen} == {(1, 0, 0)}


def test_stop_keeps_what_is_held_and_closes_no_further_when_it_is_gone(lab):
    put_box_between_fingers(lab)
    tell(lab, "go", '{"position": 0}', seconds=1.0)
    assert tell(lab, "stop", seconds=0.5).gripping == 1
    lab.world.delete("box")
    lab.run(1.0)
    assert (state(lab).gripping, state(lab).moving) == (0, 0)
    assert state(lab).position == pytest.approx(57.6, abs=12.0)


def test_holding_force_is_the_force_on_what_is_held(lab):
    put_box_between_fingers(lab)
    tell(lab, "configure", json.dumps({"holding_force": 80.0, "moving_force": 50.0}))
    assert tell(lab, "go", '{"position": 0}', seconds=1.5).force == pytest.approx(80.0, abs=3.0)


def test_force_exceeds_the_moving_force_before_it_is_the_holding_force(lab):
    """Clients that send their goal and check force or flags 20 times a second see both."""
    put_box_between_fingers(lab)
    tell(lab, "configure", json.dumps({"moving_force": 60.0, "holding_force": 20.0}))
    seen = []
    for _ in range(40):
        now = tell(lab, "go", '{"position": 0}', seconds=0.05)
        seen.append((now.moving, now.gripping, now.force))
    gripped = [gripping for _, gripping, _ in seen].index(1)
    assert gripped < 15
    assert [moving for moving, _, _ in seen[:gripped]] == [1] * gripped
    assert sum(force > 60.0 for _, _, force in seen[:gripped]) >= 2
    assert {(moving, gripping) for moving, gripping, _ in seen[gripped:]} == {(0, 1)}
    assert seen[-1][2] == pytest.approx(20.0, abs=2.0)
    assert tell(lab, "go", '{"position": 100}', seconds=0.02).gripping == 0


def test_a_goal_that_is_repeated_at_its_end_changes_nothing(lab):
    tell(lab, "go", '{"position": 0}', seconds=1.0)
    for _ in range(10):
        now = tell(lab, "go", '{"position": 0}', seconds=0.05)
        assert (now.moving, now.missed) == (0, 1)


def test_fingers_that_may_use_no_force_give_up(lab):
    tell(lab, "configure", json.dumps({"moving_force": 0.0}))
    assert tell(lab, "go", '{"position": 0}', seconds=1.0).moving == 0


@pytest.mark.parametrize("target, hooked", [(100.0, True), (0.0, False)])
def test_fingers_that_rattle_where_they_jam_come_to_rest(target, hooked):
    """Slow enough to count as standing still, without progress, and with less force than a grip needs."""
    gripper, seen = ElectricGripperHardware(0.02, 0.6), []
    take(gripper, "go", '{"position": %g}' % target)
    for tick in range(500):
        gripper.update(0.6 + 3e-4 * (-1) ** tick, lambda: 36.0)
        seen.append((gripper.moving, gripper.hooked))
    assert seen[0] == (True, False)
    assert ((True, True) in seen) == hooked
    assert seen[-1] == (False, False)


def test_fingers_move_as_one_even_pushed_from_one_side(lab):
    joints = lab.model.index(["l_gripper_l_finger_joint", "l_gripper_r_finger_joint"])
    tell(lab, "go", '{"position": 50}', seconds=1.0)
    along = lab.model.link_pose("left_gripper").matrix()[:3, 1]
    lab.run(0.5, before=lambda lab: lab.model.apply_wrench("l_gripper_l_finger", 20.0 * along))
    left, right = lab.model.read_joints()[0][joints]
    assert left > 0.0115  # gave way: 16 N hold it
    assert left == pytest.approx(-right, abs=2e-4)


@pytest.mark.parametrize("pause_s", [0.5, 6.0])
def test_what_is_held_comes_along(lab, pause_s):
    """Also after a pause, in which resting bodies fall asleep."""
    box = hold_box(lab)
    before = in_hand(lab, box)
    lab.run(pause_s)
    move_left_arm(lab, (0.3, 0.2, -0.4, -0.3, 0.5, -1.2, 1.0), 2.0)
    assert state(lab).gripping == 1
    np.testing.assert_allclose(in_hand(lab, box), before, atol=3e-4)


def in_hand(lab, box):
    """Where the box is, in the frame between the fingers."""
    hand = lab.model.link_pose("left_gripper").matrix()
    return hand[:3, :3].T @ (np.array(box.base_pose().position) - hand[:3, 3])


def move_left_arm(lab, change, seconds):
    start, names = lab.position[:7], ["left_%s" % joint for joint in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")]
    steps = round(seconds / 0.02)
    for step in range(steps):
        lab.command(1, start + (step + 1) / steps * np.array(change), names)
        lab.run(0.02)
    lab.run(0.5)


def test_a_bare_arm_is_passive(make_lab, bare_robot):
    lab = make_lab(model=bare_robot)
    lab.run(0.1)
    for side in SIDES:
        properties = lab.last("end_effector/%s_gripper/properties" % side)
        assert (properties.id, properties.ui_type) == (131073, 3)
        assert (state(lab, side).id, state(lab, side).gripping) == (131073, 2)
    configured = tell(lab, "configure", "{}", "me_configure", 3)
    assert (configured.command_sender, configured.command_sequence) == ("me_configure", 3)
    tell(lab, "go", '{"position": 0}')
    assert "the left arm carries no gripper" in lab.log.lines[-1]


def test_a_tool_that_only_the_client_knows(make_lab, bare_robot):
    lab = make_lab(model=bare_robot)
    pen = EndEffectorProperties(id=131073, ui_type=3, product="pen")
    lab.send("end_effector/left_gripper/rsdk/set_properties", pen)
    lab.run(0.02)
    assert lab.last("end_effector/left_gripper/properties").product == "pen"
    assert lab.last("end_effector/right_gripper/properties").product == "SDK End Effector"
    assert (state(lab).id, state(lab).ready) == (131073, 2)
    lab.send("end_effector/left_gripper/rsdk/set_state", EndEffectorState(id=131073, ready=1, position=30.0))
    told = tell(lab, "configure", "{}", "me_configure", 5)
    assert (told.id, told.ready, told.position) == (131073, 1, 30.0)
    assert (told.command, told.command_sender, told.command_sequence) == ("configure", "me_configure", 5)
    assert told.timestamp.to_sec() > 0.0
    tell(lab, "go", '{"position": 0}')
    assert "unknown gripper command 'go'; choices are no_op, set, configure" in lab.log.lines[-1]
    with pytest.raises(CommandRefused, match="velocity is 3; parameters are none"):
        take(CustomGripperHardware(), "configure", '{"velocity": 3}')


def test_a_gripper_that_the_robot_knows_is_not_renamed(lab):
    lab.send("end_effector/left_gripper/rsdk/set_properties", EndEffectorProperties(id=131073, ui_type=3))
    lab.run(0.02)
    assert "only a custom one can be told" in lab.log.lines[-1]
    assert lab.last("end_effector/left_gripper/properties").ui_type == 2


@pytest.fixture(scope="session")
def bare_robot(robot_file):
    without = {"%s_electric_gripper" % side: "false" for side in SIDES}
    return parse_urdf(xacro.process_file(robot_file, mappings=without).toxml(), source=robot_file)
