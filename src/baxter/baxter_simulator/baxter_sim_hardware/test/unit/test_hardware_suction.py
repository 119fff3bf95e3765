# SPDX-License-Identifier: BSD-3-Clause
"""The suction gripper: which commands it takes, and which loads its cup holds in a physics world."""
import json

import numpy as np
import pytest
from baxter_core_msgs.msg import DigitalOutputCommand, EndEffectorCommand

import xacro
from baxter_model import ModelMismatch
from baxter_model.description import cup_of
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.grippers.suction import SuctionGripperHardware
from bullet_sim import Pose
from urdf_model import parse_urdf

HEARD = ("end_effector/*", "analog_io/*", "digital_io/*")

SIDES = ("left", "right")
AREA_M2 = np.pi * 0.015**2
BOX = """<robot name="box"><link name="box">
  <collision><geometry><box size="0.06 0.06 0.04"/></geometry></collision>
  <inertial><mass value="%g"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
  </link></robot>"""


def state(lab, side="left"):
    return lab.last("end_effector/%s_gripper/state" % side)


def details(lab):
    return json.loads(state(lab).state)


def tell(lab, command, args="", sender="", sequence=0, seconds=0.02):
    lab.send("end_effector/left_gripper/command", EndEffectorCommand(65537, command, args, sender, sequence))
    lab.run(seconds)
    return state(lab)


@pytest.fixture(scope="session")
def suction_robot(robot_file):
    cups = {"%s_gripper" % side: "suction" for side in SIDES}
    return parse_urdf(xacro.process_file(robot_file, mappings=cups).toxml(), source=robot_file)


@pytest.fixture
def lab(make_lab, suction_robot):
    made = make_lab(model=suction_robot, parameters={"enable": True})
    made.run(0.1)
    return made


def put_box_on_cup(lab, gap=0.0, aside=0.0, mass=0.3):
    """Put a box at this distance in front of the cup's rim, its centre at this offset from the cup's."""
    rim = lab.model.link_pose("left_gripper").matrix()
    middle = rim[:3, 3] + rim[:3, :3] @ (aside, 0.0, gap + 0.02)
    pose = Pose(tuple(middle), lab.model.link_pose("left_gripper").quaternion)
    return lab.world.spawn(parse_urdf(BOX % mass, source="box"), "box", pose)


def suck(lab, seconds=5.0):
    """Gravity on the box near the cup starts when the pump has evacuated the cup."""
    lab.world.set_gravity((0.0, 0.0, 0.0))
    tell(lab, "go", json.dumps({"grip_attempt_seconds": seconds}), seconds=1.0)
    lab.world.set_gravity((0.0, 0.0, -9.81))
    lab.run(0.5)


def distance(lab, box):
    """From the rim to the near face, along the cup's axis."""
    rim = lab.model.link_pose("left_gripper").matrix()
    return float(rim[:3, 2] @ (np.array(box.base_pose().position) - rim[:3, 3])) - 0.02


@pytest.mark.parametrize("command, args, text", [
    ("calibrate", "", "unknown gripper command 'calibrate'; choices are no_op, set, configure"),
    ("go", '{"position": 0}', 'go needs {"grip_attempt_seconds": SECONDS}'),
    ("go", '{"grip_attempt_seconds": "long"}', "go needs"),
    ("go", '{"grip_attempt_seconds": NaN}', "go needs"),
    ("configure", '{"velocity": 10}', "velocity is 10; parameters are vacuum_sensor_threshold (0 to 100), blow_off"),
    ("configure", '{"blow_off_seconds": -1}', "blow_off_seconds is -1"),
])
def test_senseless_commands_are_refused(command, args, text):
    with pytest.raises(CommandRefused) as refusal:
        SuctionGripperHardware().take(command, args, "", 0, True)
    assert text in str(refusal.value)


def test_disabled_robot_sucks_not():
    with pytest.raises(CommandRefused, match="not enabled"):
        SuctionGripperHardware().take("go", "", "", 0, False)


@pytest.mark.parametrize("side", SIDES)
def test_properties_and_first_state(lab, side):
    properties = lab.last("end_effector/%s_gripper/properties" % side)
    assert (properties.id, properties.ui_type, properties.controls_position) == (65537, 1, False)
    first = state(lab, side)
    assert (first.id, first.enabled, first.calibrated, first.ready, first.moving, first.gripping, first.missed,
            first.error) == (65537, 1, 1, 1, 0, 0, 0, 0)
    assert json.loads(first.state) == {"vacuum sensor": 0, "vacuum": False, "blowing": False, "sucking": False}


def test_sucking_air_gives_up_after_the_attempt(lab):
    tell(lab, "go", '{"grip_attempt_seconds": 0.5}', "me_go", 3)
    assert (details(lab)["sucking"], details(lab)["vacuum"]) == (True, False)
    lab.run(0.3)
    assert 0 < details(lab)["vacuum sensor"] < 0.18 * 255
    lab.run(0.5)
    given_up = state(lab)
    assert (given_up.gripping, given_up.missed) == (0, 1)
    assert details(lab) == {"vacuum sensor": 0, "vacuum": False, "blowing": False, "sucking": False}
    assert (given_up.command, given_up.command_sender, given_up.command_sequence) == ("go", "me_go", 3)


def test_less_than_no_time_means_as_long_as_it_takes(lab):
    tell(lab, "go", '{"grip_attempt_seconds": -1}', seconds=6.0)
    assert details(lab)["sucking"]


@pytest.mark.parametrize("gap, aside, holds", [
    (0.0, 0.0, True), (0.002, 0.0, True), (0.0, 0.01, True), (0.006, 0.0, False), (0.0, 0.028, False)])
def test_holds_what_covers_the_cup_and_nothing_else(lab, gap, aside, holds):
    """The box hangs from a cup that looks down."""
    look_down(lab)
    box = put_box_on_cup(lab, gap, aside)
    suck(lab, seconds=0.3)
    assert (state(lab).gripping, details(lab)["vacuum"]) == (int(holds), holds)
    if holds:
        assert details(lab)["vacuum sensor"] > 250
        analog = lab.last("analog_io/left_vacuum_sensor_analog/state")
        assert (analog.value, analog.isInputOnly) == (pytest.approx(255.0, abs=2.0), True)
        assert distance(lab, box) == pytest.approx(0.0, abs=1e-3)
    else:
        assert distance(lab, box) > 0.1


def test_what_is_held_comes_along_and_falls_on_release(lab):
    look_down(lab)
    box = put_box_on_cup(lab)
    suck(lab)
    before = lab.model.link_pose("left_gripper").position
    lab.run(6.0)  # resting bodies fall asleep meanwhile
    swing(lab)
    assert np.linalg.norm(np.array(lab.model.link_pose("left_gripper").position) - before) > 0.1
    assert state(lab).gripping == 1
    assert distance(lab, box) == pytest.approx(0.0, abs=1e-3)
    tell(lab, "release", "", "me_release", 4, seconds=0.1)
    assert (details(lab)["sucking"], details(lab)["blowing"], details(lab)["vacuum"]) == (False, True, False)
    lab.run(0.5)
    assert not details(lab)["blowing"]
    tell(lab, "release", "", "me_release", 4)
    assert not details(lab)["blowing"]  # the same message again is the same command
    assert distance(lab, box) > 0.3


def test_more_than_the_pressure_carries_is_lost(lab):
    """60 kPa on the cup's area are 42 N, less the weight of 300 g."""
    look_down(lab)
    box = put_box_on_cup(lab)
    suck(lab)
    limit = 60e3 * AREA_M2 - 0.3 * 9.81
    lab.run(0.5, before=lambda lab: box.apply_wrench("box", (0.0, 0.0, -0.9 * limit)))
    assert state(lab).gripping == 1
    lab.run(0.5, before=lambda lab: box.apply_wrench("box", (0.0, 0.0, -1.1 * limit)))
    assert state(lab).gripping == 0
    assert distance(lab, box) > 0.1


def test_a_weaker_vacuum_counts_after_the_threshold_is_lowered(lab):
    put_box_on_cup(lab, mass=0.05)
    tell(lab, "configure", '{"vacuum_sensor_threshold": 100}')
    assert tell(lab, "go", seconds=0.2).gripping == 0
    assert details(lab)["vacuum sensor"] > 100
    assert tell(lab, "configure", '{"vacuum_sensor_threshold": 30}').gripping == 1


def test_disabling_drops_nothing_but_ends_an_attempt(lab):
    look_down(lab)
    tell(lab, "go")
    lab.enable(False)
    lab.run(0.1)
    assert not details(lab)["sucking"]
    lab.enable()
    box = put_box_on_cup(lab)
    suck(lab)
    lab.enable(False)
    lab.run(1.0)
    assert (state(lab).gripping, state(lab).enabled) == (1, 0)
    assert distance(lab, box) == pytest.approx(0.0, abs=1e-3)
    tell(lab, "stop", seconds=0.5)
    assert state(lab).gripping == 0


def switch(lab, output, on, seconds=0.05):
    lab.send("digital_io/command", DigitalOutputCommand(output, on))
    lab.run(seconds)
    return lab.last("digital_io/%s/state" % output).state


def test_the_valves_among_the_digital_outputs_suck_and_blow(lab):
    look_down(lab)
    box = put_box_on_cup(lab)
    lab.world.set_gravity((0.0, 0.0, 0.0))
    assert switch(lab, "left_suck", True, 1.0) == 1
    lab.world.set_gravity((0.0, 0.0, -9.81))
    lab.run(6.0)  # longer than an attempt of a command
    assert (details(lab)["sucking"], details(lab)["vacuum"], state(lab).gripping) == (True, True, 1)
    assert switch(lab, "left_blow", False) == 0 and details(lab)["sucking"]
    assert distance(lab, box) == pytest.approx(0.0, abs=1e-3)
    assert lab.last("digital_io/right_suck/state").state == 0
    assert switch(lab, "left_blow", True) == 1
    assert (details(lab)["sucking"], details(lab)["blowing"]) == (False, True)
    assert lab.last("digital_io/left_suck/state").state == 0
    lab.run(1.0)
    assert details(lab)["blowing"]
    assert switch(lab, "left_blow", False) == 0
    assert not details(lab)["blowing"]
    assert distance(lab, box) > 0.3


def test_the_valves_show_what_commands_do(lab):
    tell(lab, "go", '{"grip_attempt_seconds": -1}')
    assert lab.last("digital_io/left_suck/state").state == 1
    tell(lab, "release")
    assert [lab.last("digital_io/left_%s/state" % name).state for name in ("suck", "blow")] == [0, 1]


def test_a_disabled_robot_opens_no_valve(lab):
    lab.enable(False)
    assert switch(lab, "left_suck", True) == 0
    assert "not enabled" in lab.log.lines[-1]
    assert switch(lab, "left_suck", False) == 0


def test_idle_cup_costs_no_rays(lab):
    lab.world.first_hits = None
    lab.run(0.1)


def test_cup_without_a_cylinder_is_refused(suction_robot):
    strange = parse_urdf('<robot name="r"><link name="left_gripper_cup"/></robot>', source="strange")
    with pytest.raises(ModelMismatch, match="no cylinder"):
        cup_of(strange, "left")
    assert cup_of(suction_robot, "right") == ("right_gripper", 0.015)


def look_down(lab):
    """Turn the left wrist, from neutral, so that the cup looks straight down."""
    names = ["left_w1"]
    start = lab.position[5]
    tilt = np.arccos(-lab.model.link_pose("left_gripper").matrix()[2, 2])
    lab.command(1, [start + tilt], names)
    lab.run(1.0)
    if lab.model.link_pose("left_gripper").matrix()[2, 2] > -0.999:
        lab.command(1, [start - tilt], names)
        lab.run(1.0)
    assert lab.model.link_pose("left_gripper").matrix()[2, 2] < -0.999


def swing(lab):
    start = lab.position[0]
    for step in range(100):
        lab.command(1, [start + 0.004 * (step + 1)], ["left_s0"])
        lab.run(0.02)
