# SPDX-License-Identifier: BSD-3-Clause
"""A link on joints goes where they allow it."""
import math

import numpy as np
import pytest

from gazebo_ros.link_placing import joints_to, placed, rates
from urdf_model import merge_fixed, parse_urdf
from urdf_model.transforms import pose_matrix

JOINT = """<joint name="%s" type="%s"><parent link="%s"/><child link="%s"/><origin xyz="%s"/><axis xyz="%s"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>"""
ROBOT = '<robot name="r"><link name="world"/><link name="cart"/><link name="pole"/>%s%s</robot>'
CART_POLE = merge_fixed(parse_urdf(ROBOT % (JOINT % ("slide", "prismatic", "world", "cart", "0 0 1", "0 1 0"),
                                            JOINT % ("hinge", "continuous", "cart", "pole", "0.1 0 0", "1 0 0"))))
POLE = joints_to(CART_POLE, "pole")
FREE = np.full(2, -math.inf), np.full(2, math.inf)


def test_a_pole_is_put_upright_on_its_cart_in_the_middle():
    assert [joint.name for joint in POLE] == ["slide", "hinge"]
    for start in ([1.5, 2.8], [0.0, math.pi], [-1.0, -40.0]):
        position, _ = placed(POLE, np.eye(4), pose_matrix((0.1, 0.0, 1.0)), start, *FREE)
        assert position[0] == pytest.approx(0.0, abs=1e-6)
        assert math.remainder(position[1], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


def test_what_the_joints_do_not_allow_stays():
    # Off the rail, too far, and turned about another axis.
    position, jacobian = placed(POLE, np.eye(4), pose_matrix((5.0, 3.0, 0.0), (0.3, 0.0, 0.0)), [0.0, 0.0],
                                np.array([-2.0, -10.0]), np.array([2.0, 10.0]))
    assert position == pytest.approx([2.0, 0.3], abs=1e-6)
    assert rates(jacobian, (1.0, 0.5, 0.0), (0.2, 0.0, 3.0)) == pytest.approx([0.5, 0.2])
