# SPDX-License-Identifier: BSD-3-Clause
"""Damping of joints with light links: bounded, and as it is written where a description asks for implicit damping."""
import numpy as np
import pytest

from bullet_sim import World
from urdf_model import parse_urdf

DAMPING, INERTIA = 0.1, 3e-6  # as in a finger of a Shadow hand
LINK = """<link name="l%(n)d"><inertial><mass value="0.01"/><inertia ixx="1e-5" iyy="%(inertia)g" izz="1e-5"/>
</inertial></link><joint name="j%(n)d" type="revolute"><parent link="%(parent)s"/><child link="l%(n)d"/>
<axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="2" velocity="9"/><dynamics damping="%(damping)g"/></joint>
<gazebo reference="j%(n)d"><implicitSpringDamper>%(implicit)d</implicitSpringDamper></gazebo>"""
BASE = """<link name="base"><inertial><mass value="5"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>"""


@pytest.fixture(params=[0.001, 0.002], ids=["1ms", "2ms"])
def world(request):
    world = World(time_step_s=request.param)
    yield world
    world.close()


def chain(world, links=1, implicit=True, static=True):
    """A chain of links on hinges about the same direction."""
    parts = [LINK % {"n": n, "parent": "l%d" % (n - 1) if n else "base", "inertia": INERTIA, "damping": DAMPING,
                     "implicit": implicit} for n in range(links)]
    return world.spawn(parse_urdf('<robot name="chain">%s</robot>' % (BASE + "".join(parts))), "chain", static=static)


def speed_at(world, implicit, effort, static=True):
    finger = chain(world, implicit=implicit, static=static)
    for _ in range(round(0.5 / world.time_step_s)):
        finger.drive_effort(np.arange(1), np.array([effort]))
        world.step()
    return finger.read_joints()[1][0]


def test_implicit_damping_is_as_it_is_written(world):
    assert speed_at(world, True, 0.05) == pytest.approx(0.05 / DAMPING, rel=0.01)


@pytest.mark.parametrize("static", [True, False], ids=["fixed", "free"])
def test_explicit_damping_is_as_large_as_is_stable(world, static):
    bounded = 0.5 * INERTIA / world.time_step_s
    assert speed_at(world, False, 0.005, static) == pytest.approx(0.005 / bounded, rel=0.01)


def test_a_light_root_that_is_free_gives_way(world):
    """About the same axis the root and the link are felt as I1 I2 / (I1 + I2)."""
    robot = parse_urdf('<robot name="r">%s%s</robot>' % (BASE.replace("0.1", "5e-6"), LINK % {
        "n": 0, "parent": "base", "inertia": INERTIA, "damping": DAMPING, "implicit": False}))
    finger = world.spawn(robot, "r")
    assert finger.damping[0] == pytest.approx(0.5 * 5e-6 * INERTIA / (5e-6 + INERTIA) / world.time_step_s, rel=1e-3)


def test_a_free_robots_link_without_a_mass_may_be_damped(world):
    robot = parse_urdf('<robot name="r">%s<link name="l0"/><joint name="j0" type="continuous"><parent link="base"/>'
                       '<child link="l0"/><axis xyz="0 1 0"/><dynamics damping="0.1"/></joint></robot>' % BASE)
    model = world.spawn(robot, "r")
    world.step()
    assert 0.0 < model.damping[0] < 0.1


def test_a_controller_that_needs_implicit_damping_holds(world):
    # Its own damping is 8 or 16 times what the link's inertia alone makes stable.
    finger = chain(world)
    for _ in range(round(1.0 / world.time_step_s)):
        position, velocity, _ = finger.read_joints()
        finger.drive_effort(np.arange(1), 2.0 * (0.3 - position) - 0.05 * velocity)
        world.step()
    position, velocity, _ = finger.read_joints()
    assert position[0] == pytest.approx(0.3, abs=0.001) and abs(velocity[0]) < 0.01


@pytest.mark.parametrize("implicit", [True, False], ids=["implicit", "bounded"])
@pytest.mark.parametrize("static", [True, False], ids=["fixed", "free"])
def test_a_chain_of_light_links_comes_to_rest(world, static, implicit):
    world.set_gravity((0.0, 0.0, 0.0))
    fingers = chain(world, 4, implicit=implicit, static=static)
    for step in range(round(1.0 / world.time_step_s)):
        fingers.drive_effort(np.arange(4), np.array([0.01, -0.01, 0.01, -0.01]) * (step < 10))
        world.step()
    assert np.abs(fingers.read_joints()[1]).max() < 1e-3


def test_implicit_damping_is_stable_at_a_longer_step(world):
    finger = chain(world)
    world.set_time_step(4.0 * world.time_step_s)
    for _ in range(200):
        finger.drive_effort(np.arange(1), np.array([0.05]))
        world.step()
    assert finger.damping[0] == DAMPING
    assert finger.read_joints()[1][0] == pytest.approx(0.05 / DAMPING, rel=0.01)


def test_an_inertia_that_is_set_keeps_what_implicit_damping_adds(world):
    finger = chain(world)
    before = finger.inertial("l0")
    finger.set_inertial("l0", before.mass, before.inertia)
    assert np.allclose(finger.inertial("l0").inertia, np.diag([1e-5, INERTIA, 1e-5]))
    for _ in range(200):
        finger.drive_effort(np.arange(1), np.array([0.05]))
        world.step()
    assert finger.read_joints()[1][0] == pytest.approx(0.05 / DAMPING, rel=0.01)
