# SPDX-License-Identifier: BSD-3-Clause
"""Programs written for ROS Kinetic set fields that Noetic's messages lack, and give fields by position."""
import copy
import importlib
import io

import genpy
import pytest

from rospy_fixes import former_fields
from rospy_fixes.table import FIXES


@pytest.fixture
def request_type():
    class PositionIKRequest(genpy.Message):
        _md5sum, _type, __slots__, _slot_types = "0" * 32, "moveit_msgs/PositionIKRequest", ["group_name"], ["string"]

        def __init__(self, *arguments, **values):
            super().__init__(*arguments, **values)
            self.group_name = getattr(self, "group_name", None) or ""

    former_fields.amend(type("messages", (), {"PositionIKRequest": PositionIKRequest}))
    return PositionIKRequest


def test_a_former_field_is_accepted_and_told_once(request_type, capsys):
    first, second = request_type(group_name="left_arm", attempts=5), request_type()
    second.attempts = 7
    assert first.group_name == "left_arm" and second.attempts == 0 and copy.deepcopy(first) == first
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "PositionIKRequest.attempts" in told
    assert "attempts" not in str(first) and request_type.__slots__ == ["group_name"]


def test_other_unknown_fields_are_errors_as_before(request_type):
    with pytest.raises(AttributeError):
        request_type(tries=5)
    with pytest.raises(AttributeError):
        request_type().tries = 5


def test_moveits_request_is_amended_where_it_is_imported():
    from moveit_msgs.msg import PositionIKRequest

    request, plain = PositionIKRequest(), PositionIKRequest()
    request.attempts = 3
    written, expected = io.BytesIO(), io.BytesIO()
    request.serialize(written)
    plain.serialize(expected)
    assert written.getvalue() == expected.getvalue() and PositionIKRequest._md5sum


# Class -> its fields in kinetic-devel, in their order.
KINETIC = {
    "moveit_msgs.msg.CollisionObject": "header id type primitives primitive_poses meshes mesh_poses planes plane_poses "
                                       "operation",
    "moveit_msgs.msg.DisplayRobotState": "state highlight_links",
    "moveit_msgs.msg.MotionPlanRequest": "workspace_parameters start_state goal_constraints path_constraints "
                                         "trajectory_constraints planner_id group_name num_planning_attempts "
                                         "allowed_planning_time max_velocity_scaling_factor "
                                         "max_acceleration_scaling_factor",
    "moveit_msgs.msg.OrientationConstraint": "header orientation link_name absolute_x_axis_tolerance "
                                             "absolute_y_axis_tolerance absolute_z_axis_tolerance weight",
    "moveit_msgs.msg.PlaceLocation": "id post_place_posture place_pose pre_place_approach post_place_retreat "
                                     "allowed_touch_objects",
    "moveit_msgs.msg.PositionIKRequest": "group_name robot_state constraints avoid_collisions ik_link_name "
                                         "pose_stamped ik_link_names pose_stamped_vector timeout attempts",
    "moveit_msgs.srv.GetCartesianPathRequest": "header start_state group_name link_name waypoints max_step "
                                               "jump_threshold avoid_collisions path_constraints",
    "moveit_msgs.srv.GetPlannerParamsRequest": "planner_config group",
    "moveit_msgs.srv.SetPlannerParamsRequest": "planner_config group params replace",
    "gazebo_msgs.srv.SetLightPropertiesRequest": "light_name diffuse attenuation_constant attenuation_linear "
                                                 "attenuation_quadratic",
}


@pytest.mark.parametrize(("name", "fields"), KINETIC.items())
def test_all_fields_of_kinetic_by_position(name, fields, capsys):
    module, _, class_name = name.rpartition(".")
    message, fields = getattr(importlib.import_module(module), class_name), fields.split()
    values = [getattr(message(), field) for field in fields]
    marked = next(number for number, value in enumerate(values) if isinstance(value, (str, list)))
    values[marked] = "marked" if isinstance(values[marked], str) else ["marked"]
    expected = message(**{fields[marked]: values[marked]})
    assert message(*values) == expected and message(*values) == expected
    told = capsys.readouterr().err
    assert told.count("\n") <= 1 and (class_name in told or class_name in former_fields.FIELDS)  # once in a process
    with pytest.raises(TypeError):
        message(*values, *values)


def test_every_class_is_in_the_table():
    amended = {fix.module.rpartition("._")[2] for fix in FIXES if fix.fix == "former_fields"}
    assert amended == {one.removesuffix("Request") if one not in ("MotionPlanRequest", "PositionIKRequest") else one
                       for one in former_fields.FIELDS.keys() | former_fields.GAINED.keys()}
    assert {name.rpartition(".")[2] for name in KINETIC} == former_fields.FIELDS.keys() | former_fields.GAINED.keys()
