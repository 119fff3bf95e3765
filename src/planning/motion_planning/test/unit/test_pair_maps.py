# SPDX-License-Identifier: BSD-3-Clause
"""Links that pass each other closely: maps say where they touch, spheres only that they might."""
import itertools

import numpy as np
import pytest

from motion_planning.exact import ExactChecker
from motion_planning.model import PlanningModel
from motion_planning.scene import Scene
from motion_planning.spheres import SphereChecker, SphereModel
from motion_planning.spheres.pair_maps import pair_map

# As in many arms, the hand turns 10 mm beside the forearm; it meets the knob on the other side of that, and its finger
# meets the forearm where it points there.
_URDF = """<robot name="wrist">
<link name="base"/>
<joint name="swing" type="revolute"><parent link="base"/><child link="forearm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<link name="forearm"><collision><geometry><cylinder radius="0.03" length="0.3"/></geometry></collision>
<collision><origin xyz="-0.04 0 0"/><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link>
<link name="elbow"/>
<link name="hand">
<collision><origin xyz="0 0 %(height)g"/><geometry><cylinder radius="0.02" length="0.04"/></geometry></collision>
<collision><origin xyz="0.03 0 %(height)g"/><geometry><box size="0.04 0.01 0.01"/></geometry></collision></link>
<joint name="bend" type="revolute"><parent link="forearm"/><child link="elbow"/><axis xyz="0 0 1"/>
<limit lower="-7" upper="7" effort="1" velocity="1"/></joint>
<joint name="fixed" type="fixed"><parent link="elbow"/><child link="plate"/><origin xyz="0.06 0 0"/></joint>
<link name="plate"/>
<joint name="turn" type="%(type)s"><parent link="plate"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-7" upper="7" effort="1" velocity="1"/></joint>
</robot>"""
_SRDF = """<robot name="wrist"><group name="arm"><joint name="swing"/><joint name="bend"/><joint name="turn"/></group>
<group name="hand"><joint name="bend"/><joint name="turn"/></group></robot>"""


def wrist(height=0.0, kind="revolute"):
    model = PlanningModel.from_xml(_URDF % {"height": height, "type": kind}, _SRDF)
    return model, SphereModel.of(model, None), ExactChecker(model, None)


def postures(count):
    values = np.linspace(-7.0, 7.0, count)
    return np.array(list(itertools.product([0.2], values, values)))


def test_a_map_says_what_exact_geometry_says_on_the_safe_side():
    model, spheres, exact = wrist()
    checker = SphereChecker(spheres, model.groups["arm"], Scene(model))
    states = postures(61)
    scene = Scene(model)
    free = np.array([exact.free(scene, scene.state.with_q(q, model.groups["arm"].indices)) for q in states])
    found = checker.valid(states)
    assert 0.2 < free.mean() < 0.95
    assert not (found & ~free).any()
    assert found.sum() > 0.7 * free.sum()
    # What spheres alone make of it: they overlap where the hand only passes the forearm.
    with_padding = scene.with_padding({"hand": 1e-6}, {})
    assert SphereChecker(spheres, model.groups["arm"], with_padding).valid(states).sum() < 0.05 * free.sum()


def test_no_corner_of_an_open_cell_touches():
    model, spheres, exact = wrist()
    closed = pair_map(spheres, "forearm", "hand").closed.astype(bool)
    near = np.any([np.roll(closed, step, axis) for axis in (0, 1) for step in (-1, 1)], axis=0)
    rim = np.argwhere(near & ~closed)
    assert len(rim) > 50
    corners = np.concatenate([rim + offset for offset in itertools.product((0, 1), (0, 1))])
    states = np.column_stack([np.zeros(len(corners)), corners * 2.0 * np.pi / len(closed)])
    assert exact.first_blocked(Scene(model), states, "arm") is None


def test_edges_ask_the_map_too():
    model, spheres, _ = wrist()
    checker = SphereChecker(spheres, model.groups["arm"], Scene(model))
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.0, 1.0, (60, 3)) * [1.0, 3.0, 3.0]
    points[1::2] = points[::2] + rng.uniform(-0.1, 0.1, (30, 3))
    lines = checker.edges(points)
    assert lines.any() and not lines.all()
    for a, b, free in zip(points[:-1], points[1:], lines, strict=True):
        if free:
            assert checker.valid(a + (b - a) * np.linspace(0.05, 1.0, 30)[:, None]).mean() > 0.9


@pytest.mark.parametrize("height, kind", [(0.0, "prismatic"), (0.0, "fixed"), (0.4, "revolute")])
def test_there_is_no_map_without_two_joints_that_turn_or_without_need(height, kind):
    model, spheres, _ = wrist(height, kind)
    assert pair_map(spheres, "forearm", "hand") is None and pair_map(spheres, "hand", "forearm") is None


def test_a_group_that_moves_one_of_the_links_only_goes_by_spheres():
    model, spheres, _ = wrist()
    assert pair_map(spheres, "hand", "forearm") is not None
    assert not len(SphereChecker(spheres, model.groups["hand"], Scene(model)).tables[0][9])
