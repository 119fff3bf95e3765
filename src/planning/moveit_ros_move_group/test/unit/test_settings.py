# SPDX-License-Identifier: BSD-3-Clause
"""Settings from the parameter server: valid ones are understood, others are refused with the reason."""
import pytest

from moveit_ros_move_group import ros_control, settings
from moveit_ros_move_group.settings import controllers_at_present, described_scene


def test_a_robot_that_nothing_is_said_of_is_as_it_is(scene):
    assert described_scene(scene, {}) == (scene, [])


def test_padding_and_scale_of_all_links_and_of_single_ones(scene):
    found, complaints = described_scene(scene, {
        "default_robot_padding": 0.01, "default_robot_link_padding": {"hand": 0.03, "base": 0.0},
        "default_robot_link_scale": {"arm": 1.1}})
    assert complaints == []
    assert [found.link_padding.get(link, 0.0) for link in ("base", "arm", "hand")] == [0.0, 0.01, 0.03]
    assert [found.link_scale.get(link, 1.0) for link in ("base", "arm", "hand")] == [1.0, 1.1, 1.0]


def test_pairs_that_may_touch(scene):
    found, complaints = described_scene(scene, {"default_collision_operations": [
        {"object1": "arm", "object2": "table", "operation": "disable"},
        {"object1": "arm", "object2": "wall", "operation": "enable"}]})
    assert complaints == []
    assert found.allowed.allowed("table", "arm") and not found.allowed.allowed("arm", "wall")


def test_what_is_not_understood_is_said(scene):
    found, complaints = described_scene(scene, {
        "default_robot_padding": "much", "default_robot_link_padding": {"toe": 0.1, "arm": -1.0, "hand": "thick"},
        "default_collision_operations": [{"object1": "arm"}, "off", {"object1": "a", "object2": "b",
                                                                    "operation": "maybe"}]})
    assert found.link_padding == scene.link_padding and found.allowed is scene.allowed
    text = "\n".join(complaints)
    assert len(complaints) == 6
    for part in ("no such link", "of link 'arm' is -1.0", "of link 'hand' is nan", "'off' is left out", "maybe"):
        assert part in text


@pytest.mark.parametrize("manager, asked", [
    ("moveit_simple_controller_manager/MoveItSimpleControllerManager", None),
    ("moveit_ros_control_interface::MoveItControllerManager", ["/robot/controller_manager/list_controllers"]),
    ("moveit_ros_control_interface::MoveItMultiControllerManager", ["/x/controller_manager/list_controllers"])])
def test_the_controller_manager_says_where_controllers_come_from(monkeypatch, manager, asked):
    given = {"~moveit_controller_manager": manager, "~ros_control_namespace": "/robot"}
    services = []
    monkeypatch.setattr(settings.rospy, "get_param", lambda name, usual=None: given.get(name, usual))
    monkeypatch.setattr(ros_control, "_list_controllers", lambda service: services.append(service) or [])
    monkeypatch.setattr(ros_control, "_service_names", lambda: ["/x/controller_manager/list_controllers", "/y"])
    assert controllers_at_present([])() == []
    assert services == (asked or [])


def test_a_default_pipeline_that_is_not_built_in_gives_way_to_ompl(monkeypatch):
    tree = {"~planning_pipelines": {
        "chomp": {"planning_plugin": "chomp_interface/CHOMPPlanner"},
        "pilz": {"planning_plugin": "pilz_industrial_motion_planner::CommandPlanner"},
        "z": {"planning_plugin": "ompl_interface/OMPLPlanner"}}, "~default_planning_pipeline": "chomp"}
    monkeypatch.setattr(settings.rospy, "get_param", lambda name, usual=None: tree.get(name, usual))
    found, usual, complaints = settings.pipelines([])
    assert set(found) == {"pilz", "z"} and usual == "z"
    assert any("CHOMPPlanner is not built in" in text for text in complaints)
    assert any("there is no pipeline 'chomp'" in text and "'z' is taken" in text for text in complaints)


@pytest.mark.parametrize("tree", [
    {"planning_plugin": "pilz::CommandPlanner"},
    {"planning_pipelines": {"command": {"planning_plugin": "pilz::CommandPlanner"}}}])
def test_the_industrial_planner_is_known_by_its_earlier_name(monkeypatch, tree):
    """As in configurations before MoveIt took it over: LIN would be any path otherwise."""
    given = {"~": tree, "~planning_pipelines": tree.get("planning_pipelines", {}),
             "~capabilities": "pilz_trajectory_generation/MoveGroupSequenceAction",
             "~disable_capabilities": "pilz_trajectory_generation/MoveGroupSequenceService"}
    monkeypatch.setattr(settings.rospy, "get_param", lambda name, usual=None: given.get(name, usual))
    found, usual, complaints = settings.pipelines([])
    assert found[usual].industrial and "LIN" in found[usual].planners
    wanted, unknown = settings.capabilities()
    assert "pilz_industrial_motion_planner/MoveGroupSequenceAction" in wanted and unknown == []


def test_a_planner_of_an_old_configuration_that_is_not_built_in_is_named(monkeypatch):
    given = {"~": {"planning_plugin": "chomp_interface/CHOMPPlanner"}}
    monkeypatch.setattr(settings.rospy, "get_param", lambda name, usual=None: given.get(name, usual))
    found, usual, complaints = settings.pipelines([])
    assert not found[usual].industrial
    assert any("chomp_interface/CHOMPPlanner is not built in" in text for text in complaints)


@pytest.mark.parametrize("adapters, timing", [
    ("", "ruckig"), ("AddTimeParameterization ResolveConstraintFrames", "ruckig"),
    ("AddTimeOptimalParameterization", "time_optimal_trajectory_generation"),
    # The first is the outermost: it times what the second has timed.
    ("AddRuckigTrajectorySmoothing AddTimeOptimalParameterization", "ruckig"),
    ("AddIterativeSplineParameterization", "iterative_spline_parameterization")])
def test_the_outermost_adapter_times_a_motion_and_jerk_is_limited_unless_told(monkeypatch, adapters, timing):
    names = " ".join("default_planner_request_adapters/" + name for name in adapters.split())
    tree = {"~planning_pipelines": {"ompl": {"planning_plugin": "ompl_interface/OMPLPlanner",
                                             "request_adapters": names}}}
    monkeypatch.setattr(settings.rospy, "get_param", lambda name, usual=None: tree.get(name, usual))
    found, _, _ = settings.pipelines([])
    assert found["ompl"].timing == timing
