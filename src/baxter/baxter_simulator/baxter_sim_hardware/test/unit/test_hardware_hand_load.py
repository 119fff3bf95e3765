# SPDX-License-Identifier: BSD-3-Clause
"""The weight in a hand that the arms' controllers assume, and how an arm droops whose controllers assume none."""
import json

import numpy as np
import pytest
from baxter_core_msgs.msg import EndEffectorCommand

import xacro
from baxter_sim_hardware.arms import hand_load
from baxter_sim_hardware.errors import CommandRefused
from urdf_model import parse_urdf

HEARD = ("limb/*/endpoint_state",)
# Hand down, 0.94 m from the shoulder.
REACHING = np.tile([0.0, -0.2, 0.0, 0.6, 0.0, 1.0, 0.0], 2)
IN_HAND_M = 0.1
TOOL = """<link name="anvil"><inertial><origin xyz="0 0 0"/><mass value="1.0"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3"
ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="anvil" type="fixed"><parent link="left_hand"/>
<child link="anvil"/><origin xyz="0 0 %g"/></joint></robot>""" % IN_HAND_M
WEIGHT = json.dumps({"urdf": {"name": "anvil", "link": [
    {"name": "anvil", "inertial": {"mass": {"value": 1.0}, "origin": {"xyz": [0.0, 0.0, IN_HAND_M]}}}]}})


@pytest.fixture(scope="module")
def bare(robot_file):
    """Description of a robot without grippers, as XML."""
    return xacro.process_file(robot_file, mappings={"%s_electric_gripper" % side: "false"
                                                    for side in ("left", "right")}).toxml()


@pytest.fixture(scope="module")
def with_anvil(bare):
    return parse_urdf(bare.replace("</robot>", TOOL))


def hand_height(lab):
    return lab.model.link_pose("left_gripper").position[2]


def wanted_height(lab):
    part = lab.plugin._arms
    arms = lab.plugin._baxter.arms
    base = lab.model.link_pose("base").position[2]
    return base + part._chains["left"].fk(arms.commanded_position[arms.joints_of("left")])[2, 3]


def droop(lab, seconds=4.0):
    """How far the left hand is below where it is commanded to be [m]."""
    lab.run(seconds)
    return wanted_height(lab) - hand_height(lab)


def configure(lab, args, side="left"):
    lab.send("end_effector/%s_gripper/command" % side, EndEffectorCommand(131073, "configure", args, "", 0))


def test_an_arm_droops_under_a_tool_that_it_does_not_know_until_it_is_told(make_lab, with_anvil):
    lab = make_lab(model=with_anvil, parameters={"enable": True, "effects": "lag"}, angles=REACHING)
    assert 0.008 < droop(lab) < 0.015
    assert lab.last("limb/left/endpoint_state").wrench.force.z == pytest.approx(-9.81, abs=0.5)
    configure(lab, WEIGHT)
    assert abs(droop(lab)) < 0.004
    assert lab.last("limb/left/endpoint_state").wrench.force.z == pytest.approx(0.0, abs=0.5)


def test_ideal_drives_carry_what_is_described_told_or_not(make_lab, with_anvil):
    lab = make_lab(model=with_anvil, parameters={"enable": True}, angles=REACHING)
    assert abs(droop(lab, 0.5)) < 0.001
    configure(lab, WEIGHT)
    assert abs(droop(lab, 0.5)) < 0.001
    assert not any("refused" in line for line in lab.log.lines)


def test_a_weight_that_is_told_of_and_not_there_lifts_the_arm_until_it_is_taken_back(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "lag"}, angles=REACHING)
    assert abs(droop(lab, 1.0)) < 0.004
    configure(lab, WEIGHT)
    assert droop(lab, 3.0) < -0.008
    configure(lab, WEIGHT.replace("1.0}", "0.0}"))
    assert abs(droop(lab, 3.0)) < 0.004


def test_what_a_robot_knows_of_an_unknown_tool_is_the_bare_hand(make_lab, with_anvil, bare):
    labs = [make_lab(model=model, parameters={"effects": "lag"}, angles=REACHING)
            for model in (with_anvil, parse_urdf(bare))]
    known, without = (lab.plugin._simulated.snapshot().gravity[lab.arm] for lab in labs)
    np.testing.assert_allclose(known, without, atol=0.01)
    assert np.abs(labs[0].model.gravity_efforts()[labs[0].arm] - without).max() > 5.0


@pytest.mark.parametrize("urdf", [
    {}, [], None, "heavy", {"link": {}}, {"link": [{"inertial": {"mass": {"value": -1.0}}}]},
    {"link": [{"inertial": {"mass": {"value": 1e9}}}]}, {"link": [{"inertial": {"mass": {"value": True}}}]},
    {"link": [{"inertial": {"mass": {"value": 1.0}, "origin": {"xyz": [0.0, 0.0]}}}]},
    {"link": [{"inertial": {"mass": {"value": 1.0}, "origin": {"xyz": [0.0, 0.0, 3.0]}}}]},
    {"link": [{"inertial": {"mass": {"value": float("nan")}}}]}])
def test_what_is_no_weight_is_refused_with_an_example(urdf):
    with pytest.raises(CommandRefused, match=r'urdf has no weight .*"mass": {"value": 0 to 25 kg}'):
        hand_load.read_load(urdf)


def test_links_add_up():
    link = {"inertial": {"mass": {"value": 0.5}, "origin": {"xyz": [0.0, 0.0, 0.2]}}}
    load = hand_load.read_load({"name": "tool", "link": [link, {"name": "b", "inertial": {"mass": {"value": 0.5}}}]})
    assert load.mass == pytest.approx(1.0)
    np.testing.assert_allclose(load.centre, [0.0, 0.0, 0.1])


def test_a_refused_weight_leaves_the_one_before(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "lag"}, angles=REACHING)
    configure(lab, WEIGHT)
    lab.run(0.01)
    configure(lab, '{"urdf": {"link": 3}}')
    lab.run(0.01)
    assert "urdf has no weight" in lab.log.lines[-1]
    hands = lab.plugin._simulated.hands
    assert hands["left"].gripper.load.mass == 1.0 and hands["right"].gripper.load is None
