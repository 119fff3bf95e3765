# SPDX-License-Identifier: BSD-3-Clause
"""The SDK's refusals and their texts."""
import math

import pytest

from baxter_interface.joint_checks import (
    UnknownNameError,
    beyond_a_turn,
    limb_joint_names,
    require_joint,
    require_joint_values,
    require_number,
    require_side,
)
from baxter_interface.settings import SDK_VERSION, VERSIONS_SDK2ROBOT
from baxter_interface.version_check import VersionMismatch, require_compatible

LEFT = ["left_s0", "left_s1", "left_e0", "left_e1", "left_w0", "left_w1", "left_w2"]


@pytest.mark.parametrize("version", ["1.2.0", "1.2.0.57", "1.2.0-rc1"])
def test_fitting_versions_pass(version):
    require_compatible(version, SDK_VERSION, VERSIONS_SDK2ROBOT)


@pytest.mark.parametrize("version", ["2.1.2", "1.2", "1.2.10", "", "v1.2.0", 1.2, None])
def test_other_versions_are_refused_with_the_way_out(version):
    with pytest.raises(VersionMismatch) as caught:
        require_compatible(version, SDK_VERSION, VERSIONS_SDK2ROBOT)
    text = caught.value.strerror
    assert str(version) in text
    assert "works with robot software 1.2.0" in text and "rosparam set /rethink/software_version 1.2.0.57" in text
    assert isinstance(caught.value, OSError)


def test_names_go_from_shoulder_to_wrist():
    assert limb_joint_names("left") == LEFT


@pytest.mark.parametrize("side", ["middle", "Left", "", None, 1])
def test_wrong_side_lists_the_right_ones(side):
    with pytest.raises(UnknownNameError, match="'left' and 'right'"):
        require_side(side)


@pytest.mark.parametrize("kind", [ValueError, KeyError])
def test_unknown_joint_is_both_a_value_and_a_key_error_and_reads_well(kind):
    with pytest.raises(kind) as caught:
        require_joint("left_x9", LEFT)
    assert str(caught.value) == "there is no joint 'left_x9' here: the joints are " + ", ".join(LEFT)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "far", None, [1.0, 2.0], 1j])
def test_value_that_is_no_finite_number_is_refused_by_name(value):
    with pytest.raises(ValueError, match=r"left_w1 \[rad\] must be a finite number"):
        require_joint_values({"left_s0": 0.0, "left_w1": value}, LEFT, "rad")


def test_joint_of_the_other_arm_is_refused():
    with pytest.raises(UnknownNameError, match="right_s0.*left_s0"):
        require_joint_values({"right_s0": 0.0}, LEFT, "rad")


@pytest.mark.parametrize("values", [None, [0.0] * 7, "left_s0"])
def test_something_that_is_no_dict_is_refused_with_a_hint(values):
    with pytest.raises(TypeError, match="dict of joint name"):
        require_joint_values(values, LEFT, "rad")


@pytest.mark.parametrize("degrees", [45.0, -90.0])
def test_degrees_are_told_with_the_radians_that_were_meant(degrees):
    said = beyond_a_turn({"left_s0": 0.5, "left_s1": degrees})
    assert "left_s1" in said and "%g rad" % degrees in said
    assert said.endswith("is %.4f" % math.radians(degrees))


def test_angles_within_a_turn_are_left_to_the_robot():
    assert beyond_a_turn({"left_s0": 3.5, "left_w2": -6.28}) == ""


def test_numbers_of_any_kind_become_floats():
    assert require_joint_values({"left_s0": 1}, LEFT, "rad") == {"left_s0": 1.0}
    assert require_number("0.5", "ratio") == 0.5
