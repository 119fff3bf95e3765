# SPDX-License-Identifier: BSD-3-Clause
"""The compiled parts: gaps with their slopes, and the nearest velocities within bounds."""
import sys
from pathlib import Path

import numpy as np
import pytest

from motion_planning.scene import Scene, WorldObject
from motion_planning.shapes import Octree
from motion_planning.spheres import SphereModel, kernel
from moveit_servo import gaps
from moveit_servo import surroundings as module
from moveit_servo.quadratic import nearest_within
from moveit_servo.surroundings import Surroundings
from urdf_model import Box, Cylinder, Plane, Sphere
from urdf_model.transforms import pose_matrix as pose

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import planar_model  # noqa: E402

OBJECTS = [WorldObject("box", pose((0.5, 0.8, 0.0), (0.3, 0.2, 0.4)), ((Box((0.2, 0.1, 0.6)), np.eye(4)),)),
           WorldObject("post", pose((0.9, -0.5, 0.0)), ((Cylinder(0.05, 1.0), np.eye(4)),)),
           WorldObject("rod", pose((-0.4, 0.6, 0.1), (1.2, 0.1, 0.0)), ((Cylinder(0.04, 0.5), np.eye(4)),)),
           WorldObject("ball", pose((-0.5, -0.5, 0.0)), ((Sphere(0.1), np.eye(4)),)),
           WorldObject("wall", pose((1.1, 0.0, 0.0), (0.0, 1.4, 0.2)), ((Plane((0.0, 0.0, 1.0)), np.eye(4)),)),
           WorldObject("cubes", pose((0.1, 0.9, 0.0)), ((Octree(0.1, np.array(
               [[0.05, 0.05, 0.05, 0.1], [0.15, 0.05, 0.05, 0.1]])), np.eye(4)),))]


@pytest.fixture(scope="module")
def planar():
    return planar_model()


def around(model, objects):
    scene = Scene(model).with_objects(objects)
    return Surroundings(SphereModel.of(model, None), model.groups["arm"], scene)


@pytest.mark.parametrize("thing", OBJECTS, ids=lambda thing: thing.id)
def test_the_least_gap_is_that_of_all_spheres(planar, thing):
    """Beside the kernel, by points on the object's surface: no search tree, no formula of distances."""
    rng = np.random.default_rng(3)
    surroundings = around(planar, [thing])
    spheres = SphereModel.of(planar, None)
    points, compared = surface(thing, rng), []
    for _ in range(400):
        q = rng.uniform(-2.5, 2.5, 3)
        near = surroundings.near(q, np.zeros(3), 0.15)
        of_object = near.distance[~near.of_robot]
        if compared.count(bool(len(of_object))) >= 4:
            continue
        frames = planar.frames(q)
        centres = [((frames[planar.link_index[link]] @ np.append(ball[:3], 1.0))[:3], ball[3])
                   for link in ("link0", "link1", "link2") for ball in spheres.spheres(link)]
        gap = min(float(np.linalg.norm(points - centre, axis=1).min()) - radius for centre, radius in centres)
        if len(of_object) and gap > 0.01:
            assert of_object.min() == pytest.approx(gap, abs=0.025), q
        elif not len(of_object):
            assert gap > 0.15, q
        compared.append(bool(len(of_object)))
    assert compared.count(True) == 4


def surface(thing, rng):
    """Points on the surface of an object, 1 cm apart or less on average."""
    (shape, inner), = thing.shapes
    where = thing.pose @ inner
    if isinstance(shape, Octree):
        return np.concatenate([surface(WorldObject("cube", where @ pose(box[:3]), ((Box((box[3],) * 3), np.eye(4)),)),
                                       rng) for box in shape.boxes])
    if isinstance(shape, Plane):
        points = np.column_stack([rng.uniform(-1.0, 1.0, (3000, 2)), np.zeros(3000)])
    elif isinstance(shape, Sphere):
        points = rng.normal(size=(800, 3))
        points *= shape.radius / np.linalg.norm(points, axis=1, keepdims=True)
    elif isinstance(shape, Box):
        points = rng.uniform(-0.5, 0.5, (1000, 3))
        side = rng.integers(3, size=1000)
        points[np.arange(1000), side] = 0.5 * np.sign(points[np.arange(1000), side])
        points = points * shape.size
    else:
        angle, z = rng.uniform(0.0, 2.0 * np.pi, 1000), rng.uniform(-0.5, 0.5, 1000)
        points = np.column_stack([shape.radius * np.cos(angle), shape.radius * np.sin(angle), shape.length * z])
    return points @ where[:3, :3].T + where[:3, 3]


def test_slopes_are_the_changes_of_the_gaps(planar):
    rng = np.random.default_rng(5)
    surroundings = around(planar, OBJECTS[:4])
    compared = 0
    for _ in range(40):
        q, step = rng.uniform(-2.5, 2.5, 3), 1e-4 * rng.normal(size=3)
        before, after = (surroundings.near(x, np.zeros(3), 0.1) for x in (q, q + step))
        if len(before.distance) and len(before.distance) == len(after.distance):
            k = int(before.distance.argmin())
            if before.distance[k] > 0.0:
                compared += 1
                assert after.distance[k] - before.distance[k] == pytest.approx(before.slope[k] @ step, abs=2e-6)
    assert compared > 5


def test_of_many_gaps_the_smallest_are_kept(planar, monkeypatch):
    rng, compared = np.random.default_rng(6), 0
    everything = around(planar, OBJECTS)
    monkeypatch.setattr(module, "_MAX_GAPS", 2)
    few = around(planar, OBJECTS)
    for q in rng.uniform(-2.5, 2.5, (40, 3)):
        all_of_them = everything.near(q, np.zeros(3), 0.15).distance
        kept = few.near(q, np.zeros(3), 0.15).distance
        assert kept == pytest.approx(np.sort(all_of_them)[:2])
        compared += len(all_of_them) > 2
    assert compared > 10


def test_a_point_inside_an_object_is_pushed_out_of_it():
    for kind, size in ((kernel.SPHERE, (0.2, 0.0, 0.0)), (kernel.AXIS_BOX, (0.2, 0.3, 0.4)),
                       (kernel.UPRIGHT_CYLINDER, (0.2, 0.0, 0.4))):
        thing = np.zeros(kernel.OBJECT, np.float32)
        thing[12:15] = size
        distance, normal = gaps.object_distance(np.int64(kind), thing, 0, (0.15, 0.01, 0.02))
        assert distance == pytest.approx(-0.05, abs=0.003) and normal[0] == pytest.approx(1.0, abs=0.02)


def test_the_nearest_velocity_is_found_within_bounds():
    rng = np.random.default_rng(7)
    for case in range(200):
        k, m = int(rng.integers(1, 8)), int(rng.integers(0, 12))
        root = rng.normal(size=(k, k)) + 0.3 * np.eye(k)
        metric, wanted = root @ root.T + 0.05 * np.eye(k), rng.normal(size=k)
        slopes, least = rng.normal(size=(m, k)), -rng.uniform(0.0, 0.5, m) * rng.integers(0, 2, m)
        low, high = -rng.uniform(0.0, 1.0, k), rng.uniform(0.0, 1.0, k)
        found = np.empty(k)
        nearest_within(wanted, metric, slopes, least, low, high, found)
        assert (slopes @ found >= least - 1e-4).all() and (found >= low).all() and (found <= high).all(), case
        cost = (found - wanted) @ metric @ (found - wanted)
        for _ in range(200):  # none of the velocities around is better
            other = np.clip(found + 0.05 * rng.normal(size=k), low, high)
            if (slopes @ other >= least).all():
                assert (other - wanted) @ metric @ (other - wanted) > cost - 0.01, case


def test_what_is_within_bounds_stays_as_it_is():
    wanted, found = np.array((0.1, -0.2)), np.empty(2)
    held = nearest_within(wanted, np.eye(2), np.eye(2), np.full(2, -1.0), np.full(2, -1.0), np.full(2, 1.0), found)
    assert not held and found == pytest.approx(wanted)
