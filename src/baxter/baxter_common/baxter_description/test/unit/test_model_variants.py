# SPDX-License-Identifier: BSD-3-Clause
"""The model for every choice of end effectors: chains, limits, tips, masses, meshes; the lab's pose and commands."""
import itertools
import subprocess
from pathlib import Path

import numpy as np
import pytest
import rospkg

import xacro
from urdf_model import Mesh, parse_urdf
from urdf_model.transforms import axis_rotation, matrix_from_quaternion, rigid

SIDES = ("left", "right")
END_EFFECTORS = ("electric", "suction", "none")
ARM = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
URDF = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf"

# Distance of SIDE_gripper from SIDE_hand [m]: the lab's fingers, an estimate of ours, a bare flange.
TIP_DISTANCE = {"electric": 0.1577, "suction": 0.15, "none": 0.025}

# The lab sheet's answer of the IK service, and the pose it was asked for (in base; quaternion x, y, z, w).
LAB_ANGLES = {
    "left_s0": -1.0051802515115758, "left_s1": -1.0358377913378556, "left_e0": -0.33102594774694544,
    "left_e1": 1.7033657530084771, "left_w0": 0.3050684684989051, "left_w1": 0.8610601980794869,
    "left_w2": -1.4742358938106646}
LAB_POINT, LAB_QUATERNION = (0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052)


@pytest.fixture(params=itertools.product(END_EFFECTORS, END_EFFECTORS), ids="-".join)
def robot(request, expand):
    left, right = request.param
    return expand(left_gripper=left, right_gripper=right)


def pose(robot, tip, angles, base="base"):
    """Pose (4x4) of link ``tip`` in link ``base`` with the joints at ``angles`` [rad], 0 where not given."""
    result = np.eye(4)
    for joint in robot.chain(base, tip):
        turned = rigid(axis_rotation(joint.axis, angles.get(joint.name, 0.0)), np.zeros(3))
        result = result @ joint.origin @ turned
    return result


def moving_links(robot):
    """Links below at least one movable joint."""
    return [link for name, link in robot.links.items() if any(joint.movable for joint in robot.chain(robot.root, name))]


@pytest.mark.parametrize("side", SIDES)
def test_arm_joints_stand_from_shoulder_to_wrist(robot, side):
    names = [joint.name for joint in robot.chain("base", side + "_gripper") if joint.movable]
    assert names == ["%s_%s" % (side, joint) for joint in ARM]


def test_every_moving_joint_has_ordered_limits_and_a_transmission(robot):
    driven = [joint.name for transmission in robot.transmissions for joint in transmission.joints]
    assert sorted(driven) == sorted(joint.name for joint in robot.movable_joints())
    for joint in robot.movable_joints():
        limit = joint.limit
        assert limit.lower < limit.upper and limit.velocity > 0 and limit.effort > 0, joint.name


def test_every_moving_link_has_mass_and_a_physical_inertia(robot):
    for link in moving_links(robot):
        assert link.inertial.mass > 0, link.name
        assert np.linalg.eigvalsh(link.inertial.inertia).min() > 0, link.name


def test_every_mesh_exists(robot):
    rospack = rospkg.RosPack()
    files = {shape.geometry.filename for link in robot.links.values() for shape in link.visuals + link.collisions
             if isinstance(shape.geometry, Mesh)}
    assert files
    for file in files:
        package, _, relative = file.removeprefix("package://").partition("/")
        assert (Path(rospack.get_path(package)) / relative).is_file(), "%s: run ./baxter.sh setup for the meshes" % file


def test_the_parser_has_nothing_to_remark(robot):
    assert robot.name == "baxter" and robot.root == "base" and robot.warnings == []


@pytest.mark.parametrize("side, kind", list(itertools.product(SIDES, END_EFFECTORS)))
def test_tip_stands_straight_above_the_hand(expand, side, kind):
    robot = expand(**{side + "_gripper": kind})
    tip = pose(robot, side + "_gripper", {}, base=side + "_hand")
    np.testing.assert_allclose(tip, rigid(np.eye(3), (0, 0, TIP_DISTANCE[kind])), atol=1e-9)


def test_lab_angles_reach_the_lab_pose(expand):
    reached = pose(expand(), "left_gripper", LAB_ANGLES)
    wanted = matrix_from_quaternion(np.array(LAB_QUATERNION) / np.linalg.norm(LAB_QUATERNION))
    assert np.linalg.norm(reached[:3, 3] - LAB_POINT) < 0.002
    turn = np.arccos(np.clip((np.trace(wanted.T @ reached[:3, :3]) - 1) / 2, -1, 1))
    assert turn < 0.002


def test_lab_pose_belongs_to_the_gripper_and_not_to_the_hand(expand):
    assert np.linalg.norm(pose(expand(), "left_hand", LAB_ANGLES)[:3, 3] - LAB_POINT) > 0.15


@pytest.mark.parametrize("finger", ["standard_narrow", "standard_wide", "extended_narrow", "extended_wide"])
@pytest.mark.parametrize("tip", ["basic_hard_tip", "basic_soft_tip", "paddle_tip", "half_round_tip"])
def test_every_finger_and_tip_mirrors_and_opens(finger, tip):
    for slot, grasp in itertools.product((1, 2, 3, 4), ("inner", "outer")):
        gripper = electric_gripper(finger, slot, tip, grasp)
        left, right = (pose(gripper, "l_gripper_%s_finger_tip" % which, {}, base="left_hand") for which in "lr")
        np.testing.assert_allclose(left[:3, 3], right[:3, 3] * (1, -1, 1), atol=1e-12)
        assert gripper.joints["l_gripper_l_finger_joint"].limit.upper == 0.020833
        assert gripper.joints["l_gripper_r_finger_joint"].mimic.multiplier == -1


def test_each_slot_brings_the_fingers_nearer():
    distance = [pose(electric_gripper("extended_wide", slot, "paddle_tip", "inner"), "l_gripper_l_finger_tip", {},
                     base="left_hand")[1, 3] for slot in (1, 2, 3, 4)]
    np.testing.assert_allclose(np.diff(distance), -0.015)


@pytest.mark.parametrize("choice, text", [
    (("long", 2, "paddle_tip", "inner"), "finger 'long' is none of standard_narrow"),
    (("extended_narrow", 5, "paddle_tip", "inner"), "finger slot '5' is none of 1, 2, 3, 4"),
    (("extended_narrow", 2, "claw", "inner"), "finger tip 'claw' is none of basic_hard_tip"),
    (("extended_narrow", 2, "paddle_tip", "upside"), "finger grasp 'upside' is neither inner nor outer")])
def test_unknown_finger_is_refused_with_the_known_ones(choice, text):
    with pytest.raises(xacro.XacroException, match=text):
        electric_gripper(*choice)


def test_unknown_end_effector_is_refused_with_the_known_ones(expand):
    with pytest.raises(xacro.XacroException, match="left_gripper:=claw is none of electric, suction, none"):
        expand(left_gripper="claw")


def test_switches_of_the_vendor_take_the_gripper_away(expand):
    robot = expand(left_electric_gripper="false")
    fingers = [joint.name for joint in robot.movable_joints() if "finger" in joint.name]
    assert fingers == ["r_gripper_l_finger_joint", "r_gripper_r_finger_joint"]


def test_gripper_argument_wins_over_the_switch(expand):
    assert "l_gripper_l_finger" in expand(left_electric_gripper="false", left_gripper="electric").links


def test_control_logic_and_sensors_come_with_the_simulator_only(expand):
    plugins = [plugin for element in expand().gazebo for plugin in element.findall("plugin")]
    assert [plugin.get("filename") for plugin in plugins] == ["libbaxter_gazebo_ros_control.so"]
    assert plugins[0].findtext("robotNamespace") == "/robot"
    sensors = [sensor for element in expand(kinect="true").gazebo for sensor in element.findall("sensor")]
    assert {sensor.get("name"): sensor.find("plugin").get("filename") for sensor in sensors} == {
        "left_hand_camera": "libbaxter_camera.so", "right_hand_camera": "libbaxter_camera.so",
        "head_camera": "libbaxter_camera.so", "left_hand_range": "libgazebo_ros_laser.so",
        "right_hand_range": "libgazebo_ros_laser.so", "openni_camera_camera": "libgazebo_ros_openni_kinect.so"}
    assert all(sensor.getparent().get("reference") in expand(kinect="true").links for sensor in sensors)
    assert not [plugin for element in expand(gazebo="false").gazebo for plugin in element.iter("plugin")]


def test_pedestal_and_kinect_are_options(expand):
    assert "pedestal" in expand().links and "pedestal" not in expand(pedestal="false").links
    assert "kinect_link" not in expand().links
    optical = pose(expand(kinect="true"), "kinect_pc_frame", {}, base="kinect_link")[:3, :3]
    np.testing.assert_allclose(optical, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-12)


def test_cells_of_the_lab_sheet_work_as_printed(expand):
    def cell(command):
        return subprocess.run(["bash", "-c", command], cwd=URDF, capture_output=True, text=True, check=True).stdout

    assert 'name="baxter"' in cell('cat baxter.urdf.xacro | grep "robot name"')
    assert len(cell('cat baxter.urdf.xacro | grep "default"').splitlines()) >= 5
    assert "xacro:rethink_electric_gripper" in cell("cat left_end_effector.urdf.xacro")
    cell("cat %s/urdf/electric_gripper/rethink_electric_gripper.xacro"
         % rospkg.RosPack().get_path("rethink_ee_description"))
    assert cell("xacro --inorder baxter.urdf.xacro").count("<link ") == len(expand().links)


def electric_gripper(finger, slot, tip, grasp):
    """A hand with an electric gripper whose two fingers are alike, as urdf_model.Robot."""
    choice = " ".join('%s_finger="%s" %s_finger_slot="%s" %s_finger_tip="%s" %s_finger_grasp="%s"' % (
        which, finger, which, slot, which, tip, which, grasp) for which in "lr")
    document = xacro.parse("""<robot name="hand" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="left_hand"/>
      <xacro:include filename="$(find rethink_ee_description)/urdf/electric_gripper/rethink_electric_gripper.xacro"/>
      <xacro:rethink_electric_gripper side="left" %s/></robot>""" % choice)
    xacro.init_stacks(None)
    xacro.process_doc(document)
    return parse_urdf(document.toxml(), source="electric gripper")
