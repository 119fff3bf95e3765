# SPDX-License-Identifier: BSD-3-Clause
"""SRDF, limits, planners and controllers agree with the arm's URDF; launch files load; no display is one line."""
import itertools
import locale
import os
import subprocess
from pathlib import Path

import numpy as np
import pybullet
import pytest
import roslaunch.config
import roslib.packages
import rospkg
import yaml
from lxml import etree

import xacro
from urdf_model import parse_urdf

PACKAGE = Path(__file__).resolve().parents[2]
JOINTS = ["joint_%d" % number for number in range(1, 7)]
LAUNCH_FILES = sorted(path.name for path in (PACKAGE / "launch").iterdir())


@pytest.fixture(scope="module")
def robot():
    file = rospkg.RosPack().get_path("probot_description") + "/urdf/probot_anno.xacro"
    return parse_urdf(xacro.process_file(file).toxml(), source=file)


@pytest.fixture(scope="module")
def srdf():
    return etree.parse(str(PACKAGE / "config" / "probot_anno.srdf")).getroot()


def settings(name):
    return yaml.safe_load((PACKAGE / "config" / name).read_text())


def load(name, *arguments):
    file = str(PACKAGE / "launch" / name)
    return roslaunch.config.load_config_default([(file, list(arguments))], None)


def test_srdf_is_about_this_robot_and_its_chain(robot, srdf):
    assert srdf.get("name") == robot.name
    (chain,) = srdf.findall("group[@name='manipulator']/chain")
    assert (chain.get("base_link"), chain.get("tip_link")) == ("base_link", "tool0")
    assert [joint.name for joint in robot.chain("base_link", "tool0") if joint.movable] == JOINTS


@pytest.mark.parametrize("name, bent", [("home", {}), ("start", {"joint_3": 1.5708, "joint_5": 1.5708}),
                                        ("upward", {"joint_3": 1.5708, "joint_5": 1.5708})])
def test_group_state_names_all_joints_within_limits(robot, srdf, name, bent):
    (state,) = srdf.findall("group_state[@name='%s']" % name)
    assert state.get("group") == "manipulator"
    values = {joint.get("name"): float(joint.get("value")) for joint in state}
    assert values == {**dict.fromkeys(JOINTS, 0.0), **bent}
    for joint, value in values.items():
        limit = robot.joints[joint].limit
        assert limit.lower <= value <= limit.upper


def test_unchecked_pairs_are_the_adjacent_and_the_never_colliding_ones(robot, srdf):
    pairs = {(pair.get("link1"), pair.get("link2")): pair.get("reason") for pair in srdf.findall("disable_collisions")}
    links = ["base_link", *("link_%d" % number for number in range(1, 7))]
    adjacent = dict.fromkeys(itertools.pairwise(links), "Adjacent")
    never = {(links[a], links[b]): "Never" for a, b in ((0, 2), (1, 3), (2, 4), (2, 5), (2, 6), (3, 5), (3, 6), (4, 6))}
    assert pairs == {**adjacent, **never}
    assert set(links) <= set(robot.links)


@pytest.fixture
def distance(robot, tmp_path):
    """Return a function: angles, link, link -> distance between their shapes [m], or 0.01 where it is more."""
    file = rospkg.RosPack().get_path("probot_description") + "/urdf/probot_anno.xacro"
    # PyBullet reads lines in blocks of a thousand characters and adds a line break after each block, even within words.
    (tmp_path / "arm.urdf").write_text(xacro.process_file(file).toxml().replace(">", ">\n"))
    client = pybullet.connect(pybullet.DIRECT)
    # PyBullet reads numbers in the locale of the process, which may write 0,5; the simulator does not read URDFs by it.
    numbers = locale.setlocale(locale.LC_NUMERIC)
    locale.setlocale(locale.LC_NUMERIC, "C")
    arm = pybullet.loadURDF(str(tmp_path / "arm.urdf"), useFixedBase=True, physicsClientId=client)
    locale.setlocale(locale.LC_NUMERIC, numbers)
    indices, joints = {}, []
    for index in range(pybullet.getNumJoints(arm, physicsClientId=client)):
        info = pybullet.getJointInfo(arm, index, physicsClientId=client)
        indices[info[12].decode()] = index
        joints += [index] if info[1].decode() in JOINTS else []

    def closest(angles, one, other):
        for joint, angle in zip(joints, angles, strict=True):
            pybullet.resetJointState(arm, joint, angle, physicsClientId=client)
        points = pybullet.getClosestPoints(arm, arm, 0.01, indices[one], indices[other], physicsClientId=client)
        return min((point[8] for point in points), default=0.01)

    yield closest
    pybullet.disconnect(client)


def test_never_colliding_pairs_never_collide(robot, srdf, distance):
    limits = [robot.joints[name].limit for name in JOINTS]
    lower, upper = [limit.lower for limit in limits], [limit.upper for limit in limits]
    postures = np.random.default_rng(0).uniform(lower, upper, (300, 6))
    corners = np.array(list(itertools.product(*zip(lower, upper, strict=True))))
    for pair in srdf.findall("disable_collisions[@reason='Never']"):
        for angles in (*postures, *corners):
            assert distance(angles, pair.get("link1"), pair.get("link2")) > 0.0, (dict(pair.attrib), angles)


@pytest.mark.parametrize("name", ["home", "start"])
def test_group_state_is_free_of_collisions(srdf, distance, name):
    angles = [float(joint.get("value")) for joint in srdf.findall("group_state[@name='%s']/joint" % name)]
    unchecked = {(pair.get("link1"), pair.get("link2")) for pair in srdf.findall("disable_collisions")}
    links = ["base_link", *("link_%d" % number for number in range(1, 7))]
    for pair in set(itertools.combinations(links, 2)) - unchecked:
        assert distance(angles, *pair) > 0.0, pair


def test_limits_are_those_of_the_urdf(robot):
    limits = settings("joint_limits.yaml")["joint_limits"]
    assert list(limits) == JOINTS
    for name, limit in limits.items():
        assert limit["has_velocity_limits"] and limit["max_velocity"] == robot.joints[name].limit.velocity


@pytest.mark.parametrize("file, name, action", [
    ("controllers_gazebo.yaml", "probot_anno/arm_joint_controller", "follow_joint_trajectory"),
    ("controllers.yaml", "", "joint_trajectory_action")])
def test_controller_moves_all_joints_by_its_action(file, name, action):
    (controller,) = settings(file)["controller_list"]
    assert controller == {"name": name, "action_ns": action, "type": "FollowJointTrajectory", "default": True,
                          "joints": JOINTS}


def test_planners_of_the_group_are_configured():
    planning = settings("ompl_planning.yaml")
    group = planning["manipulator"]
    assert set(group["planner_configs"]) == set(planning["planner_configs"])
    assert group["default_planner_config"] in group["planner_configs"] and "RRT" in group["planner_configs"]
    assert all(entry["type"] == "geometric::" + name for name, entry in planning["planner_configs"].items())


@pytest.mark.parametrize("name", LAUNCH_FILES)
def test_launch_file_finds_what_it_starts(name):
    for node in load(name).nodes:
        assert roslib.packages.find_node(node.package, node.type), "%s/%s" % (node.package, node.type)


@pytest.mark.parametrize("name", LAUNCH_FILES)
def test_every_argument_is_explained(name):
    for argument in etree.parse(str(PACKAGE / "launch" / name)).iterfind("/arg"):
        assert argument.get("doc"), argument.get("name")


@pytest.mark.parametrize("arguments, controller", [(["gazebo:=true"], "probot_anno/arm_joint_controller"),
                                                   (["gazebo:=false"], "")])
def test_planning_server_gets_its_parameters(arguments, controller):
    config = load("moveit_planning_execution.launch", *arguments)
    values = {name: param.value for name, param in config.params.items()}
    assert values["/move_group/controller_list"][0]["name"] == controller
    assert values["/move_group/moveit_controller_manager"].startswith("moveit_simple_controller_manager/")
    assert values["/move_group/default_planning_pipeline"] == "ompl"
    assert values["/move_group/planning_pipelines/ompl/planning_plugin"] == "ompl_interface/OMPLPlanner"
    assert "manipulator" in values["/robot_description_semantic"]
    assert values["/robot_description_planning/joint_limits/joint_6/max_velocity"] == 3.0
    assert "/robot_description" not in values
    (node,) = (node for node in config.nodes if node.name == "move_group")
    assert (node.package, node.type, node.args.strip()) == ("moveit_ros_move_group", "move_group", "")


@pytest.mark.parametrize("arguments", [["fake_execution:=true"], ["moveit_controller_manager:=fake"]])
def test_fake_arms_move_as_asked_for(arguments):
    values = {name: param.value for name, param in load("move_group.launch", *arguments).params.items()}
    assert values["/move_group/moveit_controller_manager"].startswith("moveit_fake_controller_manager/")
    assert values["/move_group/controller_list"][0]["type"] == "interpolate"
    config = load("demo.launch", "fake_execution_type:=last point")
    assert config.params["/move_group/controller_list"].value[0]["type"] == "last point"


@pytest.mark.parametrize(("name", "arguments"), [
    ("move_group.launch", "gazebo debug info allow_trajectory_execution fake_execution max_safe_path_cost capabilities "
                          "jiggle_fraction publish_monitored_planning_scene disable_capabilities"),
    ("planning_context.launch", "load_robot_description robot_description"),
    ("trajectory_execution.launch.xml", "moveit_controller_manager moveit_manage_controllers gazebo"),
    ("probot_anno_moveit_controller_manager.launch.xml", "gazebo moveit_controller_manager"),
    ("fake_moveit_controller_manager.launch.xml", "gazebo"), ("planning_pipeline.launch.xml", "pipeline"),
    ("ompl_planning_pipeline.launch.xml", ""), ("chomp_planning_pipeline.launch.xml", ""),
    ("moveit_rviz.launch", "debug config"), ("demo.launch", "db db_path debug use_gui")])
def test_every_argument_of_the_originals_is_there(name, arguments):
    there = {argument.get("name") for argument in etree.parse(str(PACKAGE / "launch" / name)).iterfind("/arg")}
    assert set(arguments.split()) <= there


def test_who_asks_for_chomp_gets_ompl_beside_it():
    values = {name: param.value for name, param in load("move_group.launch", "pipeline:=chomp").params.items()}
    assert values["/move_group/default_planning_pipeline"] == "chomp"
    assert values["/move_group/planning_pipelines/chomp/planning_plugin"] == "chomp_interface/CHOMPPlanner"
    assert values["/move_group/planning_pipelines/ompl/planning_plugin"] == "ompl_interface/OMPLPlanner"


def run(executable, *arguments, **environment):
    environment = {**os.environ, **environment}
    return subprocess.run([str(PACKAGE / "nodes" / executable), *arguments], env=environment, text=True,
                          capture_output=True, timeout=30)


def test_a_display_that_is_missing_is_one_line_and_no_failure():
    done = run("moveit_rviz", str(PACKAGE / "config"), DISPLAY="")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.count("\n") == 1 and "there is no display (DISPLAY is not set)" in done.stderr


def test_rviz_has_the_display_or_says_which_package_lacks():
    done = run("moveit_rviz", str(PACKAGE / "config"), "--help", DISPLAY=":0", QT_QPA_PLATFORM="offscreen")
    installed = "moveit_ros_visualization" in rospkg.RosPack().list()
    assert ("moveit_ros_visualization is not installed" in done.stderr) is not installed
    displays = {name: {item["Class"] for item in settings(name)["Visualization Manager"]["Displays"]}
                for name in ("moveit.rviz", "arm.rviz")}
    assert displays["moveit.rviz"] - displays["arm.rviz"] == {"moveit_rviz_plugin/MotionPlanning"}
    assert "rviz/RobotModel" in displays["arm.rviz"]
