# SPDX-License-Identifier: BSD-3-Clause
"""The plugin by which wheels slip, on a cart that is pulled back."""
import numpy as np
import pytest
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import ReconfigureRequest

from bullet_sim import Pose, World
from gazebo_plugins.wheel_slip import WheelSlip
from gazebo_ros.model_plugin import PluginError
from loop_ros.names import IllegalName

INERTIAL = '<inertial><mass value="%g"/><inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/></inertial>'
WHEEL = """<link name="w{0}">%s<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="j{0}" type="continuous"><parent link="base"/><child link="w{0}"/><origin xyz="{1} {2} 0.1"/>
<axis xyz="0 1 0"/></joint>""" % INERTIAL.format(0.005) % 1.0
PLACES = [(x, y) for x in (0.3, -0.3) for y in (0.25, -0.25)]
CART = '<robot name="cart"><link name="base">%s</link>%s%%s</robot>' % (
    INERTIAL.format(0.5) % 10.0, "".join(WHEEL.format(n, *place) for n, place in enumerate(PLACES)))
WEIGHT_N = 14.0 * 9.81
PULL = 0.2  # of the weight
SPEED = 2.0


@pytest.fixture
def cart(make):
    def made(**wheels):
        raw = "".join('<wheel link_name="%s">%s</wheel>' % wheel for wheel in wheels.items())
        return make(CART, WheelSlip, {}, Pose((0, 0, 0.001)), raw=raw)

    return made


def speed(lab, seconds=3.0):
    """Of the cart [m/s] while its wheels turn and it is pulled back."""
    lab.model.drive_velocity(lab.model.index(["j%d" % n for n in range(4)]), np.full(4, SPEED / 0.1), np.full(4, 50.0))
    lab.run(seconds, lambda: lab.model.apply_wrench("base", (-PULL * WEIGHT_N, 0, 0), (0, 0, 0)))
    return lab.model.model_twist()[0][0]


FORCE = "<wheel_normal_force>%g</wheel_normal_force>" % (WEIGHT_N / 4.0)
SLIP = FORCE + "<slip_compliance_longitudinal>1</slip_compliance_longitudinal>"


def test_a_cart_is_slower_than_its_wheels_by_their_slip_which_can_be_set(cart):
    inside = SLIP + "<slip_compliance_lateral>0.5</slip_compliance_lateral>"
    lab = cart(w0=inside, w1=inside, w2=inside, w3=inside)
    assert speed(lab) == pytest.approx(SPEED * (1.0 - PULL), rel=0.02)
    config = Config(doubles=[DoubleParameter("slip_compliance_unitless_longitudinal", 0.5)])
    lab.ros.services["/cart/wheel_slip/set_parameters"](ReconfigureRequest(config))
    assert speed(lab) == pytest.approx(SPEED * (1.0 - 0.5 * PULL), rel=0.02)
    lab.plugin.close()
    assert speed(lab, 1.0) == pytest.approx(SPEED, rel=0.02)
    assert lab.log.of("warn") == []


@pytest.mark.parametrize("name, inside, words", [
    ("nose", SLIP, "'nose' does not slip: no joint turns such a link; links of wheels are w0, w1, w2, w3"),
    ("base", SLIP, "no joint turns such a link"),
    ("w1", SLIP.replace("1<", "x<"), "<slip_compliance_longitudinal> is 'x'"),
    ("w1", "<slip_compliance_lateral>1</slip_compliance_lateral>", "no <wheel_normal_force> above 0"),
    ("w1", FORCE + "<wheel_radius>-1</wheel_radius>", "<wheel_radius> is '-1'")])
def test_a_wheel_that_cannot_slip_is_named(cart, name, inside, words):
    lab = cart(w0=SLIP, **{name: inside})
    assert len(lab.log.of("warn")) == 1 and words in lab.log.of("warn")[0]


def test_a_model_whose_name_is_none_in_ros_keeps_its_friction(make, monkeypatch):
    slipped = []
    monkeypatch.setattr(World, "let_slip", lambda *_: slipped.append(1))
    with pytest.raises(IllegalName, match="a b"):
        make(CART.replace('name="cart"', 'name="a b"'), WheelSlip, {}, raw='<wheel link_name="w0">%s</wheel>' % SLIP)
    assert not slipped


def test_a_plugin_without_such_a_wheel_is_refused(cart):
    with pytest.raises(PluginError, match="there is no <wheel"):
        cart(nose=SLIP)
