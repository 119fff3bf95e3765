# SPDX-License-Identifier: BSD-3-Clause
"""Wheels that slip, against the law of it: speed of the slip = compliance * force / load * speed of the tread."""
import math

import numpy as np
import pytest

from bullet_sim import BulletSimError, Pose, World
from bullet_sim.slipping_wheels import Slip
from urdf_model import parse_urdf

RADIUS, MASS_KG = 0.2, 10.0
_INERTIAL = '<inertial><mass value="%g"/><inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/></inertial>'
WHEEL = _INERTIAL.format(0.02) % 1.0
_HELD = '<limit lower="-900" upper="900" effort="1000" velocity="100"/>'
# A wheel at an angle to its way, which its fork goes along; it may rise, and feels its load alone.
RIG = """<robot name="rig"><link name="world"/><link name="x">%(light)s</link><link name="y">%(light)s</link>
<link name="fork">%(heavy)s</link><link name="wheel">%(wheel)s<collision><geometry><%(shape)s/></geometry></collision>
</link>
<joint name="x" type="prismatic"><parent link="world"/><child link="x"/><axis xyz="1 0 0"/>%(held)s</joint>
<joint name="y" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/>%(held)s</joint>
<joint name="z" type="prismatic"><parent link="y"/><child link="fork"/><axis xyz="0 0 1"/>%(held)s
<origin rpy="0 0 %(steer)g"/></joint>
<joint name="spin" type="continuous"><parent link="fork"/><child link="wheel"/><axis xyz="0 0 1"/>
<origin xyz="0 0 0.2" rpy="-1.5707963 0 0"/></joint></robot>"""


def rig(steer=0.0, step_s=0.001, shape='sphere radius="0.2"', wheel=WHEEL, warn=pytest.fail):
    world = World(time_step_s=step_s, warn=warn)
    world.add_ground_plane()
    model = world.spawn(parse_urdf(RIG % {
        "light": _INERTIAL.format(0.01) % 0.1, "heavy": _INERTIAL.format(0.1) % (MASS_KG - 1.0),
        "wheel": wheel, "held": _HELD, "steer": steer, "shape": shape}), "rig")
    return world, model, MASS_KG * 9.81


def run(world, seconds, act=lambda: None):
    for _ in range(round(seconds / world.time_step_s)):
        act()
        world.step()


@pytest.mark.parametrize("step_s", [0.001, 0.002])
@pytest.mark.parametrize("shape", ['sphere radius="0.2"', 'cylinder radius="0.2" length="0.05"'])
@pytest.mark.parametrize("steer, compliance, expected", [
    (0.05, 0.2, math.tan(0.05) / 0.2), (0.05, 0.1, math.tan(0.05) / 0.1), (0.3, 0.1, 1.0), (0.05, 0.0, 1.0)])
def test_across_its_way_a_wheel_transmits_its_slip_over_its_compliance(steer, compliance, expected, shape, step_s):
    world, model, load = rig(steer, step_s, shape)
    world.let_slip(model, [Slip("wheel", RADIUS, load, lateral=compliance)])
    x, y = model.index(["x", "y"])
    model.drive_velocity(np.array([x]), np.array([3.0]), np.array([1000.0]))
    model.drive_position(np.array([y]), np.array([0.0]), np.array([1000.0]))
    run(world, 1.0)
    efforts = []
    run(world, 0.2, lambda: efforts.append(model.read_joints()[2][y]))
    assert abs(np.mean(efforts)) / load / math.cos(steer) == pytest.approx(expected, rel=0.05)
    world.close()


@pytest.mark.parametrize("compliance, pull", [(0.5, 0.3), (1.0, 0.1), (0.0, 0.3)])
def test_along_its_way_a_wheel_that_pulls_is_ahead_by_its_slip(compliance, pull):
    world, model, load = rig()
    world.let_slip(model, [Slip("wheel", RADIUS, load, longitudinal=compliance)])
    spin, = model.index(["spin"])
    model.drive_velocity(np.array([spin]), np.array([10.0]), np.array([500.0]))
    model.drive_position(model.index(["y"]), np.array([0.0]), np.array([1000.0]))
    run(world, 6.0, lambda: model.apply_wrench("fork", (-pull * load, 0, 0), (0, 0, 0)))
    speed = model.read_joints()[1]
    assert speed[spin] == pytest.approx(10.0, rel=0.01)
    assert speed[model.index(["x"])[0]] == pytest.approx(RADIUS * 10.0 * (1.0 - compliance * pull), rel=0.02)
    world.close()


def test_a_wheel_that_stands_does_not_slip_and_the_end_gives_friction_back():
    world, model, load = rig()
    slipping = world.let_slip(model, [Slip("wheel", RADIUS, load, 1.0, 1.0)])
    model.drive_position(model.index(["spin"]), np.array([0.0]), np.array([500.0]))
    run(world, 0.5)
    before = model.read_joints()[0]
    run(world, 2.0, lambda: model.apply_wrench("fork", (0.3 * load, 0.3 * load, 0), (0, 0, 0)))
    np.testing.assert_allclose(model.read_joints()[0], before, atol=1e-3)
    model.drive_velocity(model.index(["spin"]), np.array([10.0]), np.array([500.0]))
    run(world, 1.0, lambda: model.apply_wrench("fork", (-0.1 * load, 0, 0), (0, 0, 0)))
    assert model.read_joints()[1][0] < 1.9
    world.end_slip(slipping)
    run(world, 1.0, lambda: model.apply_wrench("fork", (-0.1 * load, 0, 0), (0, 0, 0)))
    assert model.read_joints()[1][0] == pytest.approx(2.0, rel=0.01)
    world.close()


def test_a_body_that_nothing_turns_is_refused():
    world, model, load = rig()
    for name in ("x", "world", "nose"):
        with pytest.raises(BulletSimError, match="'%s' of model 'rig' is no wheel" % name):
            world.let_slip(model, [Slip(name, RADIUS, load)])
    world.close()


# Two rows of fixed wheels, of a vehicle that turns on the spot: with slip it turns more easily.
def test_a_vehicle_that_slips_stays_calm_and_is_deleted(world):
    world.add_ground_plane()
    wheel = ('<link name="w{0}">%s<collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
             '<joint name="j{0}" type="continuous"><parent link="base"/><child link="w{0}"/><origin xyz="{1} {2} 0.1"/>'
             '<axis xyz="0 1 0"/></joint>' % (_INERTIAL.format(0.005) % 1.0))
    places = [(x, y) for x in (0.3, -0.3) for y in (0.25, -0.25)]
    robot = parse_urdf('<robot name="car"><link name="base">%s</link>%s</robot>' % (
        _INERTIAL.format(0.5) % 10.0, "".join(wheel.format(n, *place) for n, place in enumerate(places))))
    car = world.spawn(robot, "car", Pose((0, 0, 0.001)))
    load = 14.0 * 9.81 / 4.0
    world.let_slip(car, [Slip("w%d" % n, 0.1, load, 0.5, 0.1) for n in range(4)])
    car.drive_velocity(car.index(["j%d" % n for n in range(4)]), np.array([10.0] * 4), np.full(4, 50.0))
    run(world, 2.0)
    assert car.model_twist()[0][0] == pytest.approx(1.0, rel=0.02)
    assert abs(car.model_twist()[1][2]) < 0.02
    world.delete("car")
    world.step()


def test_a_wheel_whose_axle_is_no_axis_of_its_inertia_is_named():
    told = []
    world, model, load = rig(wheel=WHEEL.replace('iyz="0"', 'iyz="0.004"'), warn=told.append)
    world.let_slip(model, [Slip("wheel", RADIUS, load, lateral=0.2)])
    assert len(told) == 1 and "wheels wheel slip along both axes or not at all" in told[0]
    world.close()
