# SPDX-License-Identifier: BSD-3-Clause
"""Shapes and films."""
import threading

import numpy as np
import pytest

from motion_planning.shapes import Cone, TriangleMesh
from motion_planning_rviz import drawing
from motion_planning_rviz.playback import PAUSE_S, Playback
from motion_planning_rviz.worker import Worker
from urdf_model import Box, Cylinder, Plane, Sphere


@pytest.mark.parametrize("shape, kind, size", [
    (Box((1.0, 2.0, 3.0)), "box", (1.0, 2.0, 3.0)), (Sphere(0.5), "sphere", (1.0, 1.0, 1.0)),
    (Cylinder(0.5, 3.0), "cylinder", (1.0, 1.0, 3.0)), (Plane(), "box", (4.0, 4.0, 0.002))])
def test_sizes_are_those_of_markers(shape, kind, size):
    solid = drawing.solid_of(shape, np.eye(4))
    assert (solid.kind, solid.size) == (kind, size)


def test_a_cone_is_closed_and_faces_outwards():
    corners = drawing.solid_of(Cone(0.5, 2.0), np.eye(4)).points.reshape(-1, 3, 3)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    assert volume == pytest.approx(np.pi * 0.25 * 2.0 / 3.0, rel=0.02)


def test_a_mesh_has_its_triangles():
    mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2], [0, 1, 3]])
    points = drawing.solid_of(mesh, np.eye(4)).points
    assert points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 1]]
    assert drawing.solid_of("unknown", np.eye(4)) is None


def test_links_are_drawn_where_they_are_and_in_their_colour(twins):
    solids = drawing.link_solids(twins.robot, twins.groups["left_arm"].moving_links)
    assert {name: [solid.kind for solid in several] for name, several in solids.items()} == {
        "left_upper": ["box"], "left_hand": ["mesh"]}
    assert (solids["left_hand"][0].mesh, solids["left_hand"][0].size) == ("package://twins/hand.stl", (2.0, 2.0, 2.0))
    pose = np.eye(4)
    pose[0, 3] = 2.0
    found = drawing.drawn(solids, {"left_upper": np.eye(4), "left_hand": pose}, drawing.GOAL,
                          {"left_hand": drawing.COLLIDING})
    assert {(one.name, one.pose[0, 3], one.colour) for one in found} == {
        ("left_upper", 0.0, drawing.GOAL), ("left_hand", 2.0, drawing.COLLIDING)}


def film(twins):
    postures = np.tile(twins.default_state().q, (3, 1))
    postures[:, twins.index["left_reach"]] = (0.0, 0.5, 1.0)
    return Playback(twins, [0.0, 1.0, 3.0], postures)


@pytest.mark.parametrize("elapsed, reach", [(0.0, 0.0), (0.5, 0.25), (2.0, 0.75), (3.0 + 0.5 * PAUSE_S, 1.0),
                                            (3.0 + PAUSE_S + 1.0, 0.5)])
def test_a_film_stands_at_its_end_and_restarts(twins, elapsed, reach):
    assert film(twins).at(elapsed)[twins.index["left_reach"]] == pytest.approx(reach)


def test_only_what_moves_is_in_the_film(twins):
    one = film(twins)
    assert set(one.moving) == {"left_hand", "left_tip", "left_finger"}
    np.testing.assert_allclose(one.trail("left_tip"), [(0.1, 0.5, 0.5), (0.6, 0.5, 0.5), (1.1, 0.5, 0.5)])


@pytest.mark.parametrize("times, shape, text", [([], (0, 6), "needs a posture"), ([0.0], (1, 2), "needs a posture"),
                                                ([1.0, 0.0], (2, 6), "go backwards")])
def test_bad_films_are_refused(twins, times, shape, text):
    with pytest.raises(ValueError, match=text):
        Playback(twins, times, np.zeros(shape))


def test_a_worker_keeps_the_order_and_drops_what_is_outdated():
    done, errors, go, end = [], [], threading.Event(), threading.Event()
    worker = Worker(errors.append)
    worker.put(lambda: go.wait(60.0))
    for number in range(3):
        worker.put(lambda number=number: done.append(("drag", number)), "drag")
    worker.put(lambda: done.append("plan"))
    worker.put(lambda: 1 / 0)
    worker.put(lambda: done.append(("drag", 3)), "drag")
    worker.put(end.set)
    go.set()
    assert end.wait(60.0)
    worker.end()
    assert done == [("drag", 2), "plan", ("drag", 3)]
    assert [type(error) for error in errors] == [ZeroDivisionError]
