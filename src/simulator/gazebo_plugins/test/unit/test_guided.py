# SPDX-License-Identifier: BSD-3-Clause
"""A link follows a frame of tf; the pose of a link as odometry."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from bullet_sim import Pose
from gazebo_plugins.guided import HandOfGod, WorldOdometry
from gazebo_ros.model_plugin import PluginError

BALL = """<robot name="ball"><link name="hand"><inertial><mass value="2"/><inertia ixx="%s" iyy="%s" izz="%s" ixy="0"
ixz="0" iyz="0"/></inertial></link>%%s</robot>"""
TURN = 0.8


def desired(x, turn=0.0, name="hog_desired"):
    transform = TransformStamped(child_frame_id=name)
    transform.header.frame_id = "world"
    transform.transform.translation = Vector3(x, 0, 1)
    transform.transform.rotation = Quaternion(0, 0, math.sin(turn / 2), math.cos(turn / 2))
    return TFMessage([transform])


def yaw(model):
    axes = model.base_pose().matrix()
    return math.atan2(axes[1, 0], axes[0, 0])


def test_the_link_comes_to_the_frame_as_on_critically_damped_springs_and_has_no_weight(make):
    lab = make(BALL % (0.1, 0.1, 0.1), HandOfGod, {"linkName": "hand", "kl": "50", "ka": "20"}, Pose((0, 0, 1)))
    lab.run(0.5)
    np.testing.assert_allclose(lab.model.base_pose().position, (0, 0, 1), atol=1e-9)
    assert "hog_desired" in lab.log.of("warn")[0] and len(lab.log.of("warn")) == 1
    lab.ros.subscriptions["/tf"].put(desired(0.5, TURN))
    lab.run(0.4)
    # x(t) = 1 - (1 + w t) exp(-w t), w^2 = k / m; the turn feels half its angle.
    rate = math.sqrt(50 / 2) * 0.4
    assert lab.model.base_pose().position[0] == pytest.approx(0.5 * (1 - (1 + rate) * math.exp(-rate)), rel=0.01)
    lab.run(4.0)
    np.testing.assert_allclose(lab.model.base_pose().position, (0.5, 0, 1), atol=1e-4)
    assert yaw(lab.model) == pytest.approx(TURN, abs=1e-3)
    sent = lab.ros.publishers["/tf"].messages[-1].transforms[0]
    assert (sent.header.frame_id, sent.child_frame_id) == ("world", "hog_actual")
    assert sent.transform.translation.x == pytest.approx(0.5, abs=1e-4)
    assert len(lab.ros.publishers["/tf"].messages) == pytest.approx(441, abs=5)


def test_a_spring_that_would_be_unstable_is_bounded_and_named(make):
    lab = make(BALL % (1e-4, 1e-4, 1e-4), HandOfGod, {"linkName": "hand"}, Pose((0, 0, 1)))
    assert "<ka> of 200 is unstable" in lab.log.of("warn")[0]
    lab.ros.subscriptions["/tf"].put(desired(0.1, 3.0))
    lab.run(4.0)
    assert yaw(lab.model) == pytest.approx(3.0, abs=0.01)


@pytest.mark.parametrize("far", [1e12, math.inf])
def test_a_frame_too_far_away_pulls_nothing_and_is_named(make, far):
    lab = make(BALL % (0.1, 0.1, 0.1), HandOfGod, {"linkName": "hand"}, Pose((0, 0, 1)))
    lab.ros.subscriptions["/tf"].put(desired(far))
    lab.run(0.05)
    np.testing.assert_allclose(lab.model.base_pose().position, (0, 0, 1), atol=1e-6)
    assert "it is not pulled" in lab.log.of("warn")[-1]


@pytest.mark.parametrize(("elements", "said"), [
    ({}, "<linkName> is '', expected one of the links hand"), ({"linkName": "foot"}, "<linkName> is 'foot'"),
    ({"linkName": "hand", "kl": "-1"}, "<kl> is '-1'"), ({"linkName": "hand", "ka": "nan"}, "<ka> is 'nan'")])
def test_what_a_hand_cannot_follow_is_refused(make, elements, said):
    with pytest.raises(PluginError, match=said):
        make(BALL % (0.1, 0.1, 0.1), HandOfGod, elements)


def test_odometry_of_the_world_has_speeds_in_the_world_and_turn_rates_in_the_link(make):
    lab = make(BALL % (0.1, 0.1, 0.1), WorldOdometry, {"topicName": "pose", "frameName": "hand"},
               Pose((1, 2, 3), (0, math.sqrt(0.5), 0, math.sqrt(0.5))))
    lab.world.set_gravity((0, 0, 0))
    lab.model.set_base_twist((0.1, 0.2, 0.3), (0, 0, 0.5))
    lab.run(0.05)
    messages = lab.sent("pose")
    assert len(messages) == 50 and messages[-1].header.frame_id == "hand"
    twist, place = messages[-1].twist.twist, messages[-1].pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((1.005, 2.01, 3.015), abs=1e-6)
    assert (twist.linear.x, twist.linear.y, twist.linear.z) == pytest.approx((0.1, 0.2, 0.3))
    # z of the world is -x of the link, which is turned about y.
    assert (twist.angular.x, twist.angular.y, twist.angular.z) == pytest.approx((-0.5, 0, 0), abs=1e-3)
