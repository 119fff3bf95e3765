# SPDX-License-Identifier: BSD-3-Clause
"""Planners are listed, set and chosen by the names of ompl_planning.yaml; what stands for another is said once."""
import sys
from pathlib import Path

import pytest
from moveit_msgs.msg import Constraints, JointConstraint, MoveItErrorCodes, OrientationConstraint, PlannerParams
from moveit_msgs.srv import (
    GetMotionPlanRequest,
    GetPlannerParamsRequest,
    QueryPlannerInterfacesRequest,
    SetPlannerParamsRequest,
)

from motion_planning.planners import rrt_connect, warm_up

sys.path.insert(0, str(Path(__file__).parents[1]))
from in_process import Node  # noqa: E402


@pytest.fixture(scope="module")
def node(texts):
    warm_up()  # the time that a plan may take is none for the compiler
    parameters = {
        "robot_description": texts[0], "robot_description_semantic": texts[1], "~": {
            "planner_configs": {
                "RRTstarkConfigDefault": {"type": "geometric::RRTstar", "range": 0.0, "goal_bias": 0.05},
                "Quick": {"type": "geometric::RRTConnect", "range": 0.0}, "EST": {"type": "geometric::EST"}},
            "arm": {"default_planner_config": "EST", "planner_configs": ["RRTstarkConfigDefault", "Quick", "EST"]}}}
    with pytest.MonkeyPatch.context() as patch:
        yield Node(patch, parameters)


def request(planner_id="", to=1.0):
    message = GetMotionPlanRequest()
    plan = message.motion_plan_request
    plan.group_name, plan.planner_id, plan.allowed_planning_time = "arm", planner_id, 2.0
    plan.goal_constraints = [Constraints(joint_constraints=[JointConstraint("turn", to, 1e-3, 1e-3, 1.0),
                                                            JointConstraint("reach", 0.5, 1e-3, 1e-3, 1.0)])]
    return message


def planner_of(node):
    return next(one for one in node.kept if hasattr(one, "_planner"))._planner


def used(node, planner_id=""):
    """(planner, lines that were logged) of a request."""
    planner = planner_of(node)
    node.logged.clear()
    message = request(planner_id).motion_plan_request
    return planner._planner(message, node.context.pipelines["ompl"]), list(node.logged)


def test_planners_are_listed_once_each(node):
    interface, = node.ask("query_planner_interface", QueryPlannerInterfacesRequest()).planner_interfaces
    names = ["RRTstarkConfigDefault", "Quick", "EST"]
    assert interface.name == "OMPL" and interface.planner_ids == ["arm[%s]" % name for name in names] + names


def test_settings_of_planners_are_given_back_and_count(node):
    def asked(**names):
        params = node.ask("get_planner_params", GetPlannerParamsRequest(**names)).params
        return dict(zip(params.keys, params.values, strict=True))

    assert asked(planner_config="Quick") == {"type": "geometric::RRTConnect", "range": "0.0"}
    node.ask("set_planner_params", SetPlannerParamsRequest(
        planner_config="Quick", group="arm", params=PlannerParams(keys=["range"], values=["0.25"])))
    assert asked(planner_config="Quick", group="arm")["range"] == "0.25"
    assert asked(planner_config="Quick")["range"] == "0.0"
    assert used(node, "Quick")[0].keywords == {"reach": 0.25}
    node.ask("set_planner_params", SetPlannerParamsRequest(
        planner_config="Quick", group="arm", params=PlannerParams(keys=["range"], values=["0"])))
    assert used(node, "arm[Quick]")[0] is rrt_connect


def test_what_stands_for_another_is_said_once(node):
    planner_of(node)._remarks.clear()  # other tests may have asked before
    planner, lines = used(node)  # the group's default
    assert planner is rrt_connect
    assert lines == ["planner 'EST' is not built in; RRTConnect plans in its place"]
    assert used(node)[1] == [] and used(node, "arm[EST]")[1] == []
    assert used(node, "Warp")[1] == ["there is no planner 'Warp'; RRTConnect plans"]


def test_a_configuration_of_the_wheel_is_taken(node):
    planner, lines = used(node, "RRTstarkConfigDefault")
    assert planner.name == "RRTstar" and not lines


@pytest.mark.parametrize("planner_id", ["", "Quick", "RRTstarkConfigDefault", "FMT", "BiTRRTkConfigDefault", "Warp"])
def test_every_name_gives_a_plan(node, planner_id):
    answer = node.ask("plan_kinematic_path", request(planner_id)).motion_plan_response
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    assert answer.trajectory.joint_trajectory.points[-1].positions[0] == pytest.approx(1.0, abs=2e-3)


def test_path_constraints_of_a_message_hold(node):
    message = request(to=1.5)
    path = message.motion_plan_request.path_constraints
    path.orientation_constraints = [OrientationConstraint(
        link_name="hand", absolute_x_axis_tolerance=0.1, absolute_y_axis_tolerance=0.1, absolute_z_axis_tolerance=1.6,
        weight=1.0)]
    path.orientation_constraints[0].orientation.w = 1.0
    assert node.ask("plan_kinematic_path", message).motion_plan_response.error_code.val == MoveItErrorCodes.SUCCESS
    path.orientation_constraints[0].absolute_z_axis_tolerance = 1.0
    answer = node.ask("plan_kinematic_path", message).motion_plan_response
    assert answer.error_code.val == MoveItErrorCodes.GOAL_VIOLATES_PATH_CONSTRAINTS
    assert any("'hand' is turned" in line for line in node.logged)
