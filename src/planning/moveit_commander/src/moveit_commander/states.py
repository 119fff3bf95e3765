# SPDX-License-Identifier: BSD-3-Clause
"""moveit_msgs/RobotState and the core's states."""
from __future__ import annotations

from typing import TYPE_CHECKING

from moveit_msgs.msg import RobotState

from command_line.options import counted
from motion_planning.model import ModelError
from urdf_model.transforms import rpy_from_matrix

from .conversions import list_to_pose, list_to_transform, matrix_of, pose_of, pose_to_list, transform_to_list
from .exception import MoveItCommanderException

if TYPE_CHECKING:
    from sensor_msgs.msg import JointState

    from motion_planning.model import PlanningModel, State


def named_positions(joints: JointState) -> dict[str, float]:
    """Return {joint: position} of a sensor_msgs/JointState. Raises MoveItCommanderException for unequal lists."""
    if len(joints.name) != len(joints.position):
        raise MoveItCommanderException("the joint state has %s and %s"
                                       % (counted(len(joints.name), "name"), counted(len(joints.position), "position")))
    return dict(zip(joints.name, joints.position, strict=True))


def state_of(model: PlanningModel, message: RobotState) -> State:
    """Return the core's State of a RobotState: joints that it does not name stand at their default, nothing attached.

    Names that are not joint variables of the model are ignored. Raises MoveItCommanderException for a value that is not
    finite and for lists of unequal length.
    """
    positions = named_positions(message.joint_state)
    try:
        state = model.state({name: value for name, value in positions.items() if name in model.variables})
    except ModelError as error:
        raise MoveItCommanderException(str(error)) from None
    floating, joints = model.virtual_joint, message.multi_dof_joint_state
    if floating is None or floating.name not in joints.joint_names:
        return state
    transform = joints.transforms[joints.joint_names.index(floating.name)]
    return state.with_base(matrix_of(list_to_pose(transform_to_list(transform))))


def message_of(model: PlanningModel, state: State) -> RobotState:
    """Return the RobotState of a State: all joints that have a value, and the virtual joint where there is one."""
    message = RobotState()
    message.joint_state.header.frame_id = message.multi_dof_joint_state.header.frame_id = model.frame
    values = model.joint_values(state.q)
    message.joint_state.name, message.joint_state.position = list(values), list(values.values())
    if model.virtual_joint is not None and model.virtual_joint.type != "fixed":
        message.multi_dof_joint_state.joint_names = [model.virtual_joint.name]
        message.multi_dof_joint_state.transforms = [list_to_transform(pose_to_list(pose_of(state.base)))]
    return message


def base_variables(model: PlanningModel, state: State) -> dict[str, float]:
    """Return {variable: value} of a base that can move, empty for one that cannot.

    Position and quaternion of a base that floats; x, y, theta of one that moves in a plane.
    """
    joint = model.virtual_joint
    if joint is None or joint.type == "fixed":
        return {}
    if joint.type == "planar":
        names = ("x", "y", "theta")
        values = [*state.base[:2, 3].tolist(), rpy_from_matrix(state.base)[2]]
    else:
        names = ("trans_x", "trans_y", "trans_z", "rot_x", "rot_y", "rot_z", "rot_w")
        values = pose_to_list(pose_of(state.base))
    return {"%s/%s" % (joint.name, name): value for name, value in zip(names, values, strict=True)}
