# SPDX-License-Identifier: BSD-3-Clause
"""A box on a winch: the scene of Gazebo's worlds/harness.world."""
import math

import numpy as np
import pytest
from std_msgs.msg import Bool, Float32

from bullet_sim import Pose
from gazebo_plugins.harness import Harness
from gazebo_ros.model_plugin import PluginError

BOX = """<robot name="box"><link name="link"><inertial><origin xyz="0.1 0 0"/><mass value="0.2"/><inertia ixx="0.03"
iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>%s</robot>"""
JOINT = """<joint name="joint1" type="%s"><pose>0 0 2 0 0 0</pose><parent>%s</parent><child>%s</child>
<axis><xyz>%s</xyz><limit><lower>-0.4</lower><upper>0.1</upper><effort>10000</effort></limit></axis></joint>
<winch><joint>joint1</joint></winch>"""
HANGS = '<gazebo><plugin name="p" filename="libHarnessPlugin.so">%s</plugin></gazebo>' % JOINT


def harness(make, kind="prismatic", parent="world", child="link", axis="0 0 1"):
    hangs = HANGS % (kind, parent, child, axis)
    return make(BOX.replace("%s</robot>", hangs + "<!--%s--></robot>"), Harness, {}, Pose((0, 0, 1.5)))


def place(lab):
    return np.array(lab.model.base_pose().position)


def test_it_holds_winds_stops_at_its_limit_and_lets_go(make):
    lab = harness(make).run(0.5)
    np.testing.assert_allclose(place(lab), (0, 0, 1.5), atol=1e-3)
    velocity, detach = (lab.ros.subscriptions["/box/harness/" + name] for name in ("velocity", "detach"))
    velocity.put(Float32(-0.2))
    lab.run(1.0)
    np.testing.assert_allclose(place(lab), (0, 0, 1.3), atol=1e-3)
    velocity.put(Float32(0.0))
    lab.run(0.5)
    np.testing.assert_allclose(place(lab), (0, 0, 1.3), atol=1e-3)
    velocity.put(Float32(math.nan))
    velocity.put(Float32(-0.5))
    lab.run(1.0)
    np.testing.assert_allclose(place(lab), (0, 0, 1.1), atol=1e-3)
    velocity.put(Float32(0.0))
    detach.put(Bool(False))
    lab.run(0.1)
    detach.put(Bool(True))
    lab.run(0.15)
    assert place(lab)[2] == pytest.approx(1.1 - 0.5 * 9.81 * 0.15 ** 2, abs=2e-3)
    assert lab.model.base_twist()[0] == pytest.approx((0, 0, -9.81 * 0.15), abs=1e-2)
    detach.put(Bool(True))
    velocity.put(Float32(1.0))
    lab.run(0.05)
    lab.model.set_base_pose(Pose((1, 2, 3)))
    lab.plugin.reset()
    lab.run(0.2)
    np.testing.assert_allclose(place(lab), (1, 2, 3), atol=1e-3)


def test_it_winds_along_an_axis_of_its_link(make):
    lab = harness(make, axis="1 1 1")
    lab.ros.subscriptions["/box/harness/velocity"].put(Float32(-0.1))
    lab.run(1.0)
    np.testing.assert_allclose(place(lab), np.array((0, 0, 1.5)) - 0.1 / math.sqrt(3), atol=1e-3)


def test_a_body_that_is_rebuilt_goes_on_hanging(make):
    lab = harness(make).run(0.1)
    inertial = lab.model.inertial("link")
    lab.model.set_inertial("link", 0.3, inertial.inertia, (0.0, 0.2, 0.0))
    lab.run(0.3)
    np.testing.assert_allclose(place(lab), (0, 0, 1.5), atol=1e-3)


@pytest.mark.parametrize(("changed", "said"), [
    ({"kind": "revolute"}, "the revolute joint 'joint1'"), ({"parent": "link"}, "from 'link'"),
    ({"child": "hook"}, "<child> is 'hook', expected one of the links link"), ({"axis": "0 0 0"}, "<xyz> is zero"),
    ({"axis": "up"}, "<xyz> is 'up'")])
def test_what_is_no_winch_is_refused(make, changed, said):
    with pytest.raises(PluginError, match=said):
        harness(make, **changed)
