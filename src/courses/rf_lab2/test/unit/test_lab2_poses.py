# SPDX-License-Identifier: BSD-3-Clause
"""The maths of poses: conventions, and where the order of a quaternion matters."""
import math
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_lab2.poses import (
    homogeneous_matrix,
    moved_pose,
    pose_difference,
    quaternion,
    rotation_matrix,
    unit_quaternion,
)

SQRT_HALF = math.sqrt(0.5)
LAB_POINT = (0.644, 0.0, 0.066)
LAB_QUATERNION = (-0.381, 0.923, -0.015, 0.052)

coordinates = st.floats(-1.0, 1.0)
some_quaternions = st.tuples(*[coordinates] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


@pytest.mark.parametrize("quaternion_xyzw, x_axis_goes_to", [
    ((0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    ((0.0, 0.0, SQRT_HALF, SQRT_HALF), (0.0, 1.0, 0.0)),   # a quarter turn about z
    ((0.0, SQRT_HALF, 0.0, SQRT_HALF), (0.0, 0.0, -1.0)),  # a quarter turn about y
    ((1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),               # a half turn about x; read w first it would be none at all
])
def test_quaternion_is_read_x_y_z_w(quaternion_xyzw, x_axis_goes_to):
    assert rotation_matrix(quaternion_xyzw)[:, 0] == pytest.approx(x_axis_goes_to, abs=1e-12)


def test_half_turn_about_x_turns_y_round():
    assert rotation_matrix((1.0, 0.0, 0.0, 0.0))[:, 1] == pytest.approx((0.0, -1.0, 0.0), abs=1e-12)


def test_gripper_points_down_at_the_pose_of_the_lab():
    assert homogeneous_matrix(LAB_POINT, LAB_QUATERNION)[:3, 2] == pytest.approx((0.0, 0.0, -1.0), abs=0.15)


@given(some_quaternions)
def test_rotation_is_orthonormal_and_turns_back_into_its_quaternion(values):
    rotation = rotation_matrix(values)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert pose_difference((0, 0, 0), values, (0, 0, 0), quaternion(rotation))[1] == pytest.approx(0.0, abs=1e-6)


def test_homogeneous_matrix_maps_the_moved_origin_to_the_translation():
    matrix = homogeneous_matrix((1.0, 2.0, 3.0), LAB_QUATERNION)
    assert matrix @ (0.0, 0.0, 0.0, 1.0) == pytest.approx((1.0, 2.0, 3.0, 1.0))
    assert matrix[3].tolist() == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize("axis", "xyz")
def test_rotation_about_an_own_axis_keeps_that_axis_and_the_position(axis):
    point, turned = moved_pose(LAB_POINT, LAB_QUATERNION, axis, math.radians(90.0))
    column = "xyz".index(axis)
    assert point == pytest.approx(LAB_POINT)
    assert rotation_matrix(turned)[:, column] == pytest.approx(rotation_matrix(LAB_QUATERNION)[:, column])
    assert pose_difference(point, turned, LAB_POINT, LAB_QUATERNION)[1] == pytest.approx(math.pi / 2.0)


def test_four_quarter_turns_are_none():
    pose = (LAB_POINT, unit_quaternion(LAB_QUATERNION))
    for _ in range(4):
        pose = moved_pose(*pose, "z", math.radians(90.0))
    assert pose_difference(*pose, LAB_POINT, LAB_QUATERNION) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_shift_goes_along_the_own_axes():
    point, _ = moved_pose((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), shift_m=(0.1, 0.2, 0.3))
    assert point == pytest.approx((0.1, -0.2, 0.7))


def test_difference_of_a_quaternion_and_its_negative_is_none():
    negative = [-value for value in LAB_QUATERNION]
    assert pose_difference(LAB_POINT, LAB_QUATERNION, LAB_POINT, negative) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_small_differences_are_told():
    point, turned = moved_pose(LAB_POINT, LAB_QUATERNION, "y", 1e-6, (0.0, 0.001, 0.0))
    distance, angle = pose_difference(point, turned, LAB_POINT, LAB_QUATERNION)
    assert distance == pytest.approx(0.001) and angle == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.parametrize("values", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (math.nan, 0.0, 0.0, 1.0)])
def test_what_is_no_quaternion_is_refused(values):
    with pytest.raises(ValueError, match="x, y, z, w"):
        rotation_matrix(values)


def test_axis_that_is_none_is_refused():
    with pytest.raises(ValueError, match="x, y, z"):
        moved_pose(LAB_POINT, LAB_QUATERNION, "w")


def test_poses_load_without_ros():
    source = pathlib.Path(__file__).parents[2] / "src"
    program = ("import sys; sys.modules.update(dict.fromkeys(('rospy', 'tf2_ros', 'geometry_msgs'))); "
               "sys.path.insert(0, %r); import rf_lab2.poses" % str(source))
    subprocess.run([sys.executable, "-c", program], check=True)
