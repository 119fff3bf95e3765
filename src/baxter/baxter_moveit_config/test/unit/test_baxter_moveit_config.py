# SPDX-License-Identifier: BSD-3-Clause
"""SRDF, limits, planners and controllers agree with the robot; launch files load with common arguments."""
import itertools
from pathlib import Path

import numpy as np
import pytest
import roslaunch.config
import roslib.packages
import rospkg
import yaml
from lxml import etree

import xacro
from baxter_model import SIDES, joint_names, poses, tip_of
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.scene import Scene

PACKAGE = Path(__file__).resolve().parents[2]
LAUNCH_FILES = sorted(path.name for path in (PACKAGE / "launch").glob("*.launch*"))
ALL_JOINTS = [*joint_names("left"), *joint_names("right")]


def expand(file, **arguments):
    return xacro.process_file(str(file), mappings=arguments).toxml()


def srdf_text(**arguments):
    return expand(PACKAGE / "config" / "baxter.srdf.xacro", **arguments)


@pytest.fixture(scope="module")
def packages():
    return rospkg.RosPack()


@pytest.fixture(scope="module")
def description(packages):
    return Path(packages.get_path("baxter_description")) / "urdf" / "baxter.urdf.xacro"


@pytest.fixture(scope="module")
def model(description):
    return PlanningModel.from_xml(expand(description), srdf_text(), settings("joint_limits.yaml")["joint_limits"])


@pytest.fixture(scope="module")
def meshes(packages):
    def find(name):
        package, _, path = name.partition("package://")[2].partition("/")
        return Path(packages.get_path(package)) / path

    return MeshReader(find)


def settings(name):
    return yaml.safe_load((PACKAGE / "config" / name).read_text())


def load(name, *arguments):
    return roslaunch.config.load_config_default([(str(PACKAGE / "launch" / name), list(arguments))], None)


def parameters(name, *arguments):
    return {key: parameter.value for key, parameter in load(name, *arguments).params.items()}


@pytest.mark.parametrize("side", SIDES)
def test_groups_are_the_arms_and_hands(model, side):
    arm, hand = model.groups[side + "_arm"], model.groups[side + "_hand"]
    assert arm.joints == joint_names(side)
    assert (arm.base, arm.tip) == ("torso", tip_of(side)) and arm.chain is not None
    assert (hand.base, hand.tip, hand.joints) == (side + "_hand", tip_of(side), ())
    assert model.end_effectors[side + "_hand_eef"].parent_link == tip_of(side)
    assert arm.end_effectors == (side + "_hand_eef",)


def test_both_arms_are_one_group_and_the_planning_frame_is_the_world(model):
    both = model.groups["both_arms"]
    assert set(both.joints) == set(ALL_JOINTS) and set(both.subgroups) == {"left_arm", "right_arm"}
    assert model.frame == "world" and model.virtual_joint.type == "floating" and "world_joint" in model.passive
    assert list(model.groups) == ["left_arm", "left_hand", "right_arm", "right_hand", "both_arms"]


@pytest.mark.parametrize("side", SIDES)
def test_neutral_is_the_robots_own(model, side):
    assert model.groups[side + "_arm"].states == {side + "_neutral": poses().angles("neutral", side)}


@pytest.mark.parametrize("electric", list(itertools.product(("true", "false"), repeat=2)))
def test_every_name_is_the_robots_whatever_it_carries(description, electric):
    arguments = dict(zip(("left_electric_gripper", "right_electric_gripper"), electric, strict=True))
    model = PlanningModel.from_xml(expand(description, **arguments), srdf_text(**arguments))
    assert model.srdf.warnings == []
    links = {link for pair in model.disabled for link in pair}
    assert links <= set(model.links)
    assert ("l_gripper_l_finger" in links, "r_gripper_l_finger" in links) == tuple(one == "true" for one in electric)


def test_tips_can_be_other_links(description):
    model = PlanningModel.from_xml(expand(description), srdf_text(left_tip_name="left_hand_camera"))
    assert model.groups["left_arm"].tip == "left_hand_camera" and model.groups["right_arm"].tip == tip_of("right")


def mirrored(link):
    for a, b in (("left_", "right_"), ("right_", "left_"), ("l_gripper", "r_gripper"), ("r_gripper", "l_gripper")):
        if link.startswith(a):
            return b + link[len(a):]
    return link


def test_disabled_pairs_are_the_same_on_either_side(model):
    assert {tuple(sorted(map(mirrored, pair))) for pair in model.disabled} == model.disabled
    assert len({(pair.link1, pair.link2) for pair in model.srdf.disabled}) == len(model.srdf.disabled)


def test_never_touching_pairs_never_touch(description, meshes, model):
    never = {tuple(sorted((pair.link1, pair.link2))) for pair in model.srdf.disabled if pair.reason == "Never"}
    others = [pair for pair in model.srdf.disabled if pair.reason != "Never"]
    text = "<robot name='baxter'>%s</robot>" % "".join(
        "<disable_collisions link1='%s' link2='%s'/>" % (pair.link1, pair.link2) for pair in others)
    bare = PlanningModel.from_xml(expand(description), text)
    checker, scene = ExactChecker(bare, meshes), Scene(bare)
    generator = np.random.default_rng(4)
    for q in generator.uniform(*bare.bounds.T, (1500, len(bare.variables))):
        touching = {tuple(sorted((one.a, one.b))) for one in checker.contacts(scene, bare.state(q), most=1000)}
        assert touching & never == set()


@pytest.mark.parametrize("name", ["neutral", "start", "untucked", "tucked"])
def test_the_robots_own_poses_are_free(model, meshes, name):
    values = {joint: angle for side in SIDES for joint, angle in poses().angles(name, side).items()}
    low, high = model.bounds.T
    state = model.state(values)
    contacts = ExactChecker(model, meshes).contacts(Scene(model), state.with_q(np.clip(state.q, low, high)))
    assert [str(one) for one in contacts] == []


def test_limits_are_within_the_urdfs(description):
    limits = settings("joint_limits.yaml")["joint_limits"]
    assert list(limits) == ALL_JOINTS
    urdf = PlanningModel.from_xml(expand(description), "")
    for joint, limit in limits.items():
        assert limit["max_velocity"] <= urdf.robot.joints[joint].limit.velocity
        assert limit["max_velocity"] == (1.0 if "_w" in joint else 0.75) and limit["max_acceleration"] == 2.0


def finger_of(side):
    return side[0] + "_gripper_l_finger_joint"


def test_controllers_are_the_robots_servers():
    controllers = settings("baxter_controllers.yaml")["controller_list"]
    for side in SIDES:
        assert {"name": "/robot/limb/" + side, "action_ns": "follow_joint_trajectory", "type": "FollowJointTrajectory",
                "default": True, "joints": list(joint_names(side))} in controllers
        assert {"name": "/robot/end_effector/%s_gripper" % side, "action_ns": "gripper_action",
                "type": "GripperCommand", "percent": True, "joints": [finger_of(side)]} in controllers
    assert len(controllers) == 2 * len(SIDES)
    assert {joint for one in settings("fake_controllers.yaml")["controller_list"] for joint in one["joints"]} == {
        *ALL_JOINTS, *map(finger_of, SIDES)}


def test_planners_of_every_arm_are_configured():
    planning = settings("ompl_planning.yaml")
    for group in ("left_arm", "right_arm", "both_arms"):
        entry = planning[group]
        assert set(entry["planner_configs"]) == set(planning["planner_configs"])
        assert entry["default_planner_config"] == "RRTConnectkConfigDefault"
        assert entry["longest_valid_segment_fraction"] == 0.05
    assert set(settings("kinematics.yaml")) == {"left_arm", "right_arm"}


@pytest.mark.parametrize("name", LAUNCH_FILES)
def test_launch_file_finds_what_it_starts(name):
    for node in load(name).nodes:
        assert roslib.packages.find_node(node.package, node.type), "%s/%s" % (node.package, node.type)


@pytest.mark.parametrize("name", LAUNCH_FILES)
def test_every_argument_is_explained(name):
    for argument in etree.parse(str(PACKAGE / "launch" / name)).iterfind("/arg"):
        assert argument.get("doc"), argument.get("name")


CONTEXT = {"load_robot_description", "left_electric_gripper", "right_electric_gripper", "left_tip_name",
           "right_tip_name"}
RVIZ, CAMERAS = {"config", "rviz_config"}, {"kinect", "xtion", "camera_link_pose"}


@pytest.mark.parametrize(("name", "arguments"), [
    ("move_group.launch", {"debug", "info", "allow_trajectory_execution", "fake_execution", "max_safe_path_cost",
                           "jiggle_fraction", "publish_monitored_planning_scene", "planner"} | CAMERAS),
    ("planning_context.launch", CONTEXT | {"robot_description"}),
    ("planning_pipeline.launch", {"pipeline"}), ("ompl_planning_pipeline.launch", set()),
    ("chomp_planning_pipeline.launch", set()), ("fake_moveit_controller_manager.launch", set()),
    ("trajectory_execution.launch", {"moveit_controller_manager", "moveit_manage_controllers"}),
    ("baxter_moveit_controller_manager.launch", {"moveit_controller_manager", "controller_manager_name",
                                                 "use_controller_manager"}),
    ("sensor_manager.launch", CAMERAS | {"moveit_sensor_manager"}), ("baxter_moveit_sensor_manager.launch", CAMERAS),
    ("moveit_rviz.launch", RVIZ | {"debug"}),
    ("baxter_grippers.launch", CONTEXT | RVIZ | CAMERAS),
    ("demo_baxter.launch", CONTEXT | RVIZ | CAMERAS | {"planner", "debug"}),
    ("demo_kinect.launch", CONTEXT | RVIZ | {"planner", "debug", "camera_link_pose"}),
    ("demo_xtion.launch", CONTEXT | RVIZ | {"planner", "debug", "camera_link_pose"}),
    ("demo_dummy.launch", CONTEXT - {"load_robot_description"} | RVIZ | CAMERAS | {"planner", "debug", "use_gui", "db",
                                                                                   "db_path"})])
def test_every_argument_of_the_vendors_files_is_there(name, arguments):
    """roslaunch refuses an argument that an included file does not have."""
    there = {argument.get("name") for argument in etree.parse(str(PACKAGE / "launch" / name)).iterfind("/arg")}
    assert arguments <= there, sorted(arguments - there)


def test_the_planning_server_alone_has_all_that_it_waits_for_but_the_robot():
    values = parameters("move_group.launch")
    assert "left_neutral" in values["/robot_description_semantic"] and "/robot_description" not in values
    assert values["/robot_description_planning/joint_limits/left_s0/max_velocity"] == 0.75
    assert values["/robot_description_kinematics/left_arm/kinematics_solver"]
    values = parameters("move_group.launch", "load_robot_description:=true", "planner:=pilz_industrial_motion_planner")
    assert values["/robot_description"].startswith("<?xml")
    assert any(key.startswith("/move_group/planning_pipelines/pilz") for key in values)
    assert parameters("baxter_planning_execution.launch", "left_tip_name:=left_wrist")[
        "/robot_description_semantic"].count("left_wrist") > values["/robot_description_semantic"].count("left_wrist")


@pytest.mark.parametrize(("name", "arguments"), [
    ("move_group.launch", ("kinect:=true",)), ("baxter_planning_execution.launch", ("xtion:=true",)),
    ("sensor_manager.launch", ("kinect:=true",)), ("baxter_moveit_sensor_manager.launch", ("xtion:=true",))])
def test_a_camera_is_where_the_vendors_files_say(name, arguments):
    assert parameters(name, *arguments)["/move_group/octomap_frame"] == "camera_link"
    (camera,) = (node for node in load(name, *arguments).nodes if "camera" in node.name)
    assert camera.args.split() == ["0.15", "0.075", "0.5", "0.0", "0.7854", "0.0", "torso", "camera_link"]
    assert "/move_group/octomap_frame" not in parameters(name)


def test_who_asks_for_chomp_gets_ompl_beside_it():
    values = parameters("demo_baxter.launch", "planner:=chomp", "rviz:=false")
    assert values["/move_group/default_planning_pipeline"] == "chomp"
    assert values["/move_group/planning_pipelines/chomp/planning_plugin"] == "chomp_interface/CHOMPPlanner"
    assert values["/move_group/planning_pipelines/ompl/planning_plugin"] == "ompl_interface/OMPLPlanner"


@pytest.mark.parametrize(("name", "plugin"), [("demo_kinect.launch", "PointCloud"),
                                              ("demo_xtion.launch", "DepthImage")])
def test_the_demo_of_a_camera_is_the_whole_demo(name, plugin):
    assert plugin in parameters(name)["/move_group/sensors"][0]["sensor_plugin"]
    assert {"move_group", "camera_link_broadcaster"} <= {node.name for node in load(name).nodes}


def test_the_tutorials_command():
    values = parameters("demo_baxter.launch", "right_electric_gripper:=true", "left_electric_gripper:=true")
    assert "/robot_description" not in values
    assert "left_neutral" in values["/robot_description_semantic"]
    assert values["/robot_description_planning/joint_limits/left_s0/max_velocity"] == 0.75
    assert values["/move_group/moveit_controller_manager"].startswith("moveit_simple_controller_manager/")
    assert [one["name"] for one in values["/move_group/controller_list"]][:2] == [
        "/robot/limb/right", "/robot/limb/left"]
    assert values["/move_group/trajectory_execution/allowed_start_tolerance"] == 0.1
    assert values["/move_group/planning_pipelines/ompl/planning_plugin"] == "ompl_interface/OMPLPlanner"
    assert "/move_group/sensors" not in values
    (server,) = (node for node in load("demo_baxter.launch").nodes if node.name == "move_group")
    assert ("joint_states", "/robot/joint_states") in [tuple(pair) for pair in server.remap_args]


def test_without_a_robot_nobody_moves():
    values = parameters("demo_dummy.launch", "rviz:=false")
    assert values["/robot_description"].startswith("<?xml")
    assert values["/move_group/moveit_controller_manager"].startswith("moveit_fake_controller_manager/")
    assert values["/move_group/controller_list"][0]["type"] == "interpolate"
    assert values["/joint_state_publisher/source_list"] == ["move_group/fake_controller_joint_states"]


@pytest.mark.parametrize(("argument", "plugin"), [("kinect:=true", "PointCloud"), ("xtion:=true", "DepthImage")])
def test_cameras_make_obstacles(argument, plugin):
    values = parameters("demo_baxter.launch", argument)
    assert plugin in values["/move_group/sensors"][0]["sensor_plugin"]
    assert (values["/move_group/octomap_frame"], values["/move_group/octomap_resolution"]) == ("camera_link", 0.02)
    (camera,) = (node for node in load("demo_baxter.launch", argument).nodes if "camera" in node.name)
    assert camera.args.split() == ["0.15", "0.075", "0.5", "0.0", "0.7854", "0.0", "torso", "camera_link"]


@pytest.mark.parametrize("display", ["", ":7"])
def test_rviz_opens_where_there_is_a_display(monkeypatch, display):
    monkeypatch.setenv("DISPLAY", display)
    assert any(node.name == "rviz" for node in load("demo_baxter.launch").nodes) == bool(display)
