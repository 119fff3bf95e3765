# SPDX-License-Identifier: BSD-3-Clause
"""A camera's points as cells: what is entered, what is cleared, what is not seen at all."""
import time

import numpy as np
import pytest

from motion_planning.exact import ExactChecker
from motion_planning.occupancy import CloudMap, Mask, OccupancyMap, SensorView
from motion_planning.planners.planning import sphere_model_of
from motion_planning.scene import AttachedBody, Scene, WorldObject
from motion_planning.spheres.cover import CoverError
from urdf_model import Box, Cylinder, Sphere
from urdf_model.transforms import axis_rotation, inverse, rigid

SIDE = 0.02
FAR_AWAY = rigid(np.eye(3), (0.0, 0.0, 50.0))
# An optical frame, z ahead, at 1 m height, that looks along x.
EYE = rigid(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), (-1.0, 0.0, 1.0))


def picture(things, eye=EYE, width=160, height=120):
    """Points (n, 3) of balls ((centre, radius), ...) and of nothing behind them, in the frame of ``eye``."""
    across, down = np.meshgrid(np.linspace(-0.55, 0.55, width), np.linspace(-0.42, 0.42, height))
    rays = np.stack([across, down, np.ones_like(across)], axis=-1).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    ranges = np.full(len(rays), np.nan)
    for centre, radius in things:
        centre = (inverse(eye) @ np.append(centre, 1.0))[:3]
        along = rays @ centre
        under = along**2 - centre @ centre + radius**2
        hit = along - np.sqrt(np.where(under >= 0.0, under, np.nan))
        ranges = np.fmin(ranges, np.where(hit > 0.0, hit, np.nan))
    return rays * ranges[:, None]


BACK = ((6.0, 0.0, 1.0), 4.0)  # a large ball behind everything, its front 3 m from the eye
CAN = ((0.5, 0.1, 1.0), 0.1)


@pytest.fixture(scope="module")
def empty(probot, meshes):
    """A mask in which nothing is."""
    model = probot
    scene = Scene(model, model.state(base=FAR_AWAY))
    return Mask(scene, sphere_model_of(ExactChecker(model, meshes)))


def view(things, frame=None, max_range=5.0, eye=EYE):
    return SensorView(picture(things, eye), eye, np.eye(4) if frame is None else frame, max_range)


def cubes(occupancy, frame=None):
    """Centres (n, 3) in the planning frame."""
    octree = occupancy.octree()
    frame = np.eye(4) if frame is None else frame
    return np.empty((0, 3)) if octree is None else octree.boxes[:, :3] @ frame[:3, :3].T + frame[:3, 3]


@pytest.mark.parametrize("frame", [np.eye(4), rigid(axis_rotation(np.array([0.6, 0.0, 0.8]), 0.7), (0.2, 0.1, -0.4))])
def test_points_become_cubes_where_they_are(empty, frame):
    occupancy = OccupancyMap(SIDE)
    changed, outside = occupancy.see(view([CAN], frame), empty)
    assert changed and outside.sum() > 100
    gaps = np.linalg.norm(cubes(occupancy, frame) - CAN[0], axis=1) - CAN[1]
    assert len(gaps) > 20 and np.abs(gaps).max() <= 0.5 * np.sqrt(3.0) * SIDE + 1e-6
    changed, _ = occupancy.see(view([CAN], frame), empty)
    assert not changed


def test_what_goes_away_is_cleared_by_rays_that_pass(empty):
    occupancy = OccupancyMap(SIDE)
    for _ in range(4):
        occupancy.see(view([CAN, BACK]), empty)
    near = len([x for x in cubes(occupancy)[:, 0] if x < 1.0])
    assert near > 20
    occupancy.see(view([CAN]), empty)  # nothing is seen beside the can: no ray clears the ball behind it
    assert (cubes(occupancy)[:, 0] > 1.5).sum() > 100
    for _ in range(10):
        occupancy.see(view([BACK]), empty)
    assert (cubes(occupancy)[:, 0] > 1.5).all()


def test_what_is_behind_something_stays(empty):
    occupancy = OccupancyMap(SIDE)
    hidden = ((1.2, 0.15, 1.0), 0.05)
    for _ in range(3):
        occupancy.see(view([hidden, BACK]), empty)
    for _ in range(10):
        occupancy.see(view([CAN, BACK]), empty)
    centres = cubes(occupancy)
    assert (np.linalg.norm(centres - hidden[0], axis=1) < 0.08).sum() > 3
    assert (np.linalg.norm(centres - CAN[0], axis=1) < 0.13).sum() > 20


def test_beyond_the_range_nothing_is_entered_but_rays_clear(empty):
    occupancy = OccupancyMap(SIDE)
    occupancy.see(view([CAN], max_range=2.0), empty)
    assert len(occupancy)
    for _ in range(3):
        occupancy.see(view([BACK], max_range=2.0), empty)
    assert len(occupancy) == 0 and occupancy.octree() is None


def test_the_robot_does_not_see_itself(probot, meshes):
    spheres = sphere_model_of(ExactChecker(probot, meshes))
    scene = Scene(probot)
    tip = probot.frame_of(scene.state.q, "link_6")[:3, 3]
    eye = rigid(EYE[:3, :3], tip - (1.0, 0.0, 0.0))
    beside = tip + (0.0, 0.3, 0.0)
    occupancy = OccupancyMap(SIDE)
    seen = view([(tip, 0.02), (beside, 0.02)], eye=eye)
    _, outside = occupancy.see(seen, Mask(scene, spheres, 0.03))
    centres = cubes(occupancy)
    assert len(centres) and np.linalg.norm(centres - beside, axis=1).max() < 0.05
    assert 0 < outside.sum() < np.isfinite(seen.points[:, 0]).sum()
    # What it was not, while it stood elsewhere, is removed where it comes to be.
    moved = Scene(probot, probot.state(base=rigid(np.eye(3), beside - tip)))
    changed, _ = occupancy.see(view([], eye=eye), Mask(moved, spheres, 0.05))
    assert changed and len(occupancy) == 0


@pytest.mark.parametrize("shape", [Sphere(0.12), Box((0.24, 0.24, 0.24)), Cylinder(0.12, 0.24)])
@pytest.mark.parametrize("held", [False, True])
def test_objects_of_the_scene_are_not_seen_again(probot, meshes, shape, held):
    spheres = sphere_model_of(ExactChecker(probot, meshes))
    turned = rigid(axis_rotation(np.array([0.0, 0.0, 1.0]), 0.5), CAN[0])
    scene = Scene(probot, probot.state(base=FAR_AWAY))
    if held:
        hand = scene.frame("link_6")
        body = AttachedBody(WorldObject("can", inverse(hand) @ turned, [(shape, np.eye(4))]), "link_6")
        scene = scene.with_state(scene.state.with_attached({"can": body}))
    else:
        scene = scene.with_object(WorldObject("can", turned, [(shape, np.eye(4))]))
    occupancy = OccupancyMap(SIDE)
    occupancy.see(view([CAN]), Mask(scene, spheres))
    assert len(occupancy) == 0
    occupancy.see(view([((0.5, -0.3, 1.0), 0.05)]), Mask(scene, spheres))
    assert len(occupancy) > 5


def test_a_link_that_spheres_cannot_cover_is_not_seen_either(probot, meshes, monkeypatch):
    spheres = sphere_model_of(ExactChecker(probot, meshes))
    scene = Scene(probot)
    tip = probot.frame_of(scene.state.q, "link_6")[:3, 3]
    eye = rigid(EYE[:3, :3], tip - (1.0, 0.0, 0.0))

    def cannot(link):
        raise CoverError("too large")

    monkeypatch.setattr(spheres, "spheres", cannot)
    occupancy = OccupancyMap(SIDE)
    occupancy.see(view([(tip, 0.02), (tip + (0.0, 0.3, 0.0), 0.02)], eye=eye), Mask(scene, spheres, 0.03))
    centres = cubes(occupancy)
    assert len(centres) and (np.linalg.norm(centres - tip, axis=1) > 0.2).all()


def test_nothing_and_nonsense_change_nothing(empty):
    occupancy = OccupancyMap(SIDE)
    points = np.array([[np.nan] * 3, [np.inf, 0.0, 1.0], [0.0, 0.0, 0.0], [1e30, 0.0, 0.0]])
    assert not occupancy.see(SensorView(points, EYE, np.eye(4), 5.0), empty)[0]
    assert not occupancy.see(SensorView(np.empty((0, 3)), EYE, np.eye(4), 5.0), empty)[0]
    # In range, but out of the tree.
    tiny = OccupancyMap(1e-5)
    assert not tiny.see(view([CAN]), empty)[0]
    with pytest.raises(ValueError, match="above 0"):
        OccupancyMap(0.0)


def test_a_whole_picture_is_entered_in_moderate_time(empty, record_property):
    occupancy = OccupancyMap(SIDE)
    points = picture([CAN, BACK], width=640, height=480)
    took = []
    for _ in range(3):
        begin = time.process_time()
        occupancy.see(SensorView(points, EYE, np.eye(4), 5.0), empty)
        took.append(time.process_time() - begin)
    record_property("seconds", min(took))
    print("%d points, %d cells: %.0f ms" % (np.isfinite(points[:, 0]).sum(), len(occupancy), 1e3 * min(took)))
    assert len(occupancy) > 1000


# -- without a memory -----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("frame", [np.eye(4), rigid(axis_rotation(np.array([0.6, 0.0, 0.8]), 0.7), (0.2, 0.1, -0.4))])
def test_a_cloud_alone_fills_the_same_cubes_as_the_first_one_of_a_map(empty, frame):
    remembering, alone = OccupancyMap(SIDE), CloudMap(SIDE)
    one = view([CAN, BACK], frame, max_range=3.2)
    remembering.see(one, empty)
    changed, _ = alone.see(one, empty)
    assert changed and len(alone) > 100 and np.array_equal(cubes(alone), cubes(remembering))
    assert not alone.see(one, empty)[0]


def test_the_next_cloud_of_a_source_takes_the_place_of_its_last_one(empty):
    alone = CloudMap(SIDE)
    alone.see(view([CAN]), empty, "one")
    alone.see(view([BACK]), empty, "other")
    assert (cubes(alone)[:, 0] < 1.0).any() and (cubes(alone)[:, 0] > 1.5).any()
    alone.see(view([BACK]), empty, "one")
    assert (cubes(alone)[:, 0] > 1.5).all()
    assert alone.see(view([]), empty, "one")[0] and alone.see(view([]), empty, "other")[0] and alone.octree() is None
    alone.see(view([CAN]), empty, "one")
    alone.clear()
    assert not len(alone) and alone.see(view([CAN]), empty, "one")[0]


def test_a_cloud_alone_does_not_show_the_robot(probot, meshes):
    scene = Scene(probot)
    mask = Mask(scene, sphere_model_of(ExactChecker(probot, meshes)), padding=0.02)
    points = np.concatenate([probot.frames(scene.state.q)[:, :3, 3], [[0.5, 0.5, 0.5]]])
    alone = CloudMap(0.05)
    _, outside = alone.see(SensorView(points, np.eye(4), np.eye(4), 5.0), mask)
    assert outside[-1] and len(alone) < len(points) and not outside.all()
    _, outside = alone.see(SensorView(np.array([[0.0, 0.0, 9.0], [np.nan] * 3]), np.eye(4), np.eye(4), 5.0), mask)
    assert outside.tolist() == [True, False] and not len(alone)
