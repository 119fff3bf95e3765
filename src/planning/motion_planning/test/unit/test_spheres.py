# SPDX-License-Identifier: BSD-3-Clause
"""Spheres contain what they stand for, and the compiled checker says what exact geometry says, on the safe side."""
import itertools
import time

import numpy as np
import pytest

from motion_planning.exact import ExactChecker
from motion_planning.model import PlanningModel
from motion_planning.scene import Scene, WorldObject
from motion_planning.shapes import Cone, Octree, TriangleMesh
from motion_planning.spheres import CoverError, Patience, SphereChecker, SphereModel, sphere_model, tables
from motion_planning.spheres import cover as covers
from motion_planning.spheres.cover import ball, boxes_of_cells, cover, voxels
from motion_planning.spheres.world_tables import forest, pyramid, solids_of, tree_of
from urdf_model import Box, Cylinder, Plane, Sphere
from urdf_model.transforms import pose_matrix as pose

TOLERANCE = 0.01
# CPU time of 300 balls of 100 spheres, as a robot's tables have [s]; a loop in Python takes 0.05 or more.
MAX_BALLS_S = 0.02
SOLIDS = [Box((0.3, 0.02, 0.1)), Box((0.01, 0.0135, 0.1127)), Cylinder(0.06, 0.27), Cylinder(0.04, 0.02), Sphere(0.1)]


def points_in(solid, rng, count=4000):
    """Random points of a solid, half of them on its surface."""
    if isinstance(solid, Sphere):
        points = rng.normal(size=(count, 3))
        return solid.radius * points / np.linalg.norm(points, axis=1, keepdims=True)
    if isinstance(solid, Box):
        points = rng.uniform(-0.5, 0.5, (count, 3))
        side = rng.integers(3, size=count // 2)
        points[np.arange(count // 2), side] = 0.5 * np.sign(points[np.arange(count // 2), side])
        return points * solid.size
    radius, z = solid.radius * np.sqrt(rng.random(count)), rng.uniform(-0.5, 0.5, count)
    radius[: count // 4] = solid.radius
    z[count // 4 : count // 2] = 0.5 * np.sign(z[count // 4 : count // 2])
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z * solid.length])


def outside_of(solid, points):
    """How far points (n, 3) are outside of a solid."""
    if isinstance(solid, Sphere):
        return np.maximum(np.linalg.norm(points, axis=1) - solid.radius, 0.0)
    if isinstance(solid, Box):
        return np.linalg.norm(np.maximum(np.abs(points) - 0.5 * np.array(solid.size), 0.0), axis=1)
    return np.hypot(np.maximum(np.hypot(points[:, 0], points[:, 1]) - solid.radius, 0.0),
                    np.maximum(np.abs(points[:, 2]) - 0.5 * solid.length, 0.0))


@pytest.mark.parametrize("solid", SOLIDS, ids=str)
def test_spheres_contain_a_solid_and_reach_little_beyond_it(solid):
    rng = np.random.default_rng(1)
    where = pose((0.1, -0.2, 0.3), (0.3, -0.5, 1.0))
    spheres = cover([(solid, where)], TOLERANCE)
    points = points_in(solid, rng) @ where[:3, :3].T + where[:3, 3]
    gap = (np.linalg.norm(points[:, None] - spheres[None, :, :3], axis=2) - spheres[:, 3]).min(axis=1)
    assert gap.max() <= 0.0
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rims = np.concatenate([centre + radius * directions for *centre, radius in spheres])
    assert outside_of(solid, (rims - where[:3, 3]) @ where[:3, :3]).max() <= 1.01 * TOLERANCE


def test_spheres_contain_a_mesh(meshes, baxter):
    mesh = meshes(baxter.robot.links["pedestal"].collisions[0].geometry.filename)
    spheres = cover([(mesh, np.eye(4))], 0.05)
    rng = np.random.default_rng(2)
    corners = mesh.vertices[mesh.triangles[rng.integers(len(mesh.triangles), size=5000)]]
    weights = rng.dirichlet((1.0, 1.0, 1.0), size=5000)
    points = (corners * weights[:, :, None]).sum(axis=1)
    gap = (np.linalg.norm(points[:, None] - spheres[None, :, :3], axis=2) - spheres[:, 3]).min(axis=1)
    assert gap.max() <= 0.0


@pytest.mark.parametrize("solid", [Box((float("nan"), 1.0, 1.0)), Box((1e9, 1.0, 1.0)), "cheese"])
def test_what_cannot_be_contained_says_so(solid):
    with pytest.raises(CoverError):
        cover([(solid, np.eye(4))], TOLERANCE)


def test_a_large_solid_is_contained_more_coarsely():
    spheres = cover([(Box((50.0, 40.0, 3.0)), np.eye(4))], TOLERANCE)
    points = points_in(Box((50.0, 40.0, 3.0)), np.random.default_rng(9))
    gap = (np.linalg.norm(points[:, None] - spheres[None, :, :3], axis=2) - spheres[:, 3]).min(axis=1)
    assert gap.max() <= 0.0 and len(spheres) < 2000


def test_ball_contains_its_spheres():
    rng = np.random.default_rng(3)
    spheres = np.column_stack([rng.normal(size=(30, 3)), rng.uniform(0.1, 0.5, 30)])
    found = ball(spheres)
    assert (np.linalg.norm(spheres[:, :3] - found[:3], axis=1) + spheres[:, 3] <= found[3] + 1e-9).all()


def test_boxes_are_the_cells_and_no_more():
    rng = np.random.default_rng(4)
    full = rng.random((6, 7, 8)) < 0.4
    boxes = boxes_of_cells(full, np.zeros(3), 1.0)
    again = np.zeros(full.shape, dtype=int)
    for low, high in boxes.astype(int):
        again[low[0]:high[0], low[1]:high[1], low[2]:high[2]] += 1
    assert (again == full).all()


def test_voxels_fill_what_is_closed_and_leave_a_bowl_open():
    side = np.linspace(-1.0, 1.0, 41)
    u, v = (axis.ravel() for axis in np.meshgrid(side, side))
    one = np.ones_like(u)
    walls = [np.column_stack(w) for w in ((u, v, -one), (u, -one, v), (u, one, v), (-one, u, v), (one, u, v))]
    lid = np.column_stack((u, v, one))
    assert voxels([np.concatenate([*walls, lid])], 0.1)[0][12, 12, 12]
    assert not voxels([np.concatenate(walls)], 0.1)[0][12, 12, 12]


def soup(count, size=1.0):
    """Triangles with corners anywhere in a cube."""
    rng = np.random.default_rng(1)
    return TriangleMesh(size * rng.random((300, 3)), rng.integers(300, size=(count, 3)))


@pytest.mark.parametrize("mesh", [soup(2000), soup(50, 1e5), TriangleMesh(np.zeros((1, 3)), [(0, 0, 0)] * 500),
                                  TriangleMesh([(0, 0, 0), (1e5, 0, 0), (0, 1e-9, 0)], [(0, 1, 2)])],
                         ids=["large triangles", "huge", "a point", "a hair"])
def test_a_mesh_costs_no_more_than_its_bound(mesh, monkeypatch):
    """2,000 triangles of a metre are 250 million samples at the usual distance."""
    monkeypatch.setattr(sphere_model, "_MAX_POINTS", 50_000)
    monkeypatch.setattr(covers, "OF_OBJECTS", covers.WorkBound(50_000, 100_000, 2_000_000, 2_000))
    made = []
    points_on = covers.points_on

    def counted(*arguments):
        for points in points_on(*arguments):
            made.append(len(points))
            yield points

    monkeypatch.setattr(covers, "points_on", counted)
    monkeypatch.setattr(sphere_model, "points_on", counted)
    boxes = sphere_model.mesh_boxes([(mesh, np.eye(4))], sphere_model.MESH_CELL_M)[1:]
    assert sum(made) <= 50_000 + len(mesh.vertices)
    made.clear()
    spheres = covers.cover_object([(mesh, np.eye(4))], TOLERANCE)[1:]
    assert sum(made) <= 60 * 50_000 and max(made) <= 50_000
    corners = mesh.vertices[mesh.triangles]
    weights = np.random.default_rng(2).dirichlet((1.0, 1.0, 1.0), len(corners))
    inside = np.einsum("nk,nka->na", weights, corners)[:200]
    low, high = boxes[:, 0], boxes[:, 1]
    assert ((inside[:, None] >= low) & (inside[:, None] <= high)).all(axis=2).any(axis=1).all()
    far = np.linalg.norm(inside[:, None] - spheres[:, :3], axis=2) - spheres[:, 3]
    assert far.min(axis=1).max() <= 1e-6 * max(1.0, np.abs(mesh.vertices).max())


@pytest.mark.parametrize("solid", [Box((1e5, 0.0, 0.0)), Box((1e4, 1e-9, 1e-3)), Box((1e3, 1e3, 0.0)),
                                   Cylinder(1e-9, 1e4), Cylinder(1e4, 0.0), Box((0.0, 0.0, 0.0)),
                                   Cone(1e3, 1e-9), Box((0.3, 0.2, 0.1))],
                         ids=str)
@pytest.mark.parametrize("late", [False, True])
def test_a_held_object_of_any_size_gets_few_spheres_that_contain_it(solid, late):
    geometry = pyramid(solid) if isinstance(solid, Cone) else solid
    where = pose((0.1, -0.2, 0.3), (0.3, -0.5, 1.0))
    spheres, beyond = sphere_model.object_spheres([(geometry, where)], TOLERANCE, late)
    assert 0 < len(spheres) <= covers.OF_OBJECTS.spheres
    assert beyond is not None or not late and max(getattr(solid, "size", (9.0,))) <= 0.3
    points = geometry.vertices if isinstance(solid, Cone) else points_in(solid, np.random.default_rng(1), 400)
    points = points @ where[:3, :3].T + where[:3, 3]
    far = np.linalg.norm(points[:, None] - spheres[:, :3], axis=2) - spheres[:, 3]
    assert far.min(axis=1).max() <= 1e-9 * np.abs(points).max()


def test_a_held_object_of_many_shapes_gets_few_spheres_that_contain_it(monkeypatch):
    monkeypatch.setattr(tables, "_MAX_HALVINGS", 6)
    corners = np.random.default_rng(2).normal(size=(50, 3))
    held = WorldObject("h", np.eye(4), tuple((Box((0.01, 0.01, 0.01)), pose(corner)) for corner in corners))
    coarse = set()
    spheres = tables._spheres_of(held, TOLERANCE, Patience(late=lambda: True), coarse)
    assert len(spheres) == 64 and coarse
    points = corners + [0.005, -0.005, 0.005]
    assert all((np.linalg.norm(spheres[:, :3] - point, axis=1) <= spheres[:, 3]).any() for point in points)


# -- the checker ----------------------------------------------------------------------------------------------------

ROD = """<robot name="rod"><link name="base"/><link name="x"/><link name="y"/><link name="ball">
  <collision><geometry><sphere radius="0.1"/></geometry></collision></link>%s</robot>""" % "".join(
    """<joint name="%s" type="prismatic"><parent link="%s"/><child link="%s"/><axis xyz="%s"/>
       <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>""" % joint
    for joint in (("jx", "base", "x", "1 0 0"), ("jy", "x", "y", "0 1 0"), ("jz", "y", "ball", "0 0 1")))
ROD_SRDF = "<robot name='rod'><group name='g'><joint name='jx'/><joint name='jy'/><joint name='jz'/></group></robot>"


@pytest.fixture(scope="module")
def rod():
    """A ball that slides along three axes: where it is is what the joints say."""
    return PlanningModel.from_xml(ROD, ROD_SRDF)


WALL = TriangleMesh([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], [[0, 1, 2], [0, 2, 3]])
SHAPES = [Box((0.5, 0.3, 0.2)), Cylinder(0.2, 0.6), Sphere(0.3), Plane(), Cone(0.3, 0.5), WALL,
          Octree(0.1, [[0.05, 0.05, 0.05, 0.1], [0.4, -0.4, 0.4, 0.8]])]


@pytest.mark.parametrize("where", [pose((0.2, 0.1, -0.3)), pose((0.2, 0.1, -0.3), (0.4, 1.0, -2.0))],
                         ids=["upright", "tilted"])
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_ball_meets_what_it_meets_by_exact_geometry(rod, shape, where):
    scene = Scene(rod).with_object(WorldObject("thing", where, ((shape, pose((0.1, 0.0, 0.0))),)))
    checker = SphereChecker(SphereModel.of(rod, None), rod.groups["g"], scene)
    exact = ExactChecker(rod, None)
    states = where[:3, 3] + np.random.default_rng(5).uniform(-0.45, 0.45, (400, 3))
    free = checker.valid(states)
    # Meshes and cones stand in boxes of some millimetres; the others are what they are.
    beyond = 0.06 if isinstance(shape, Cone | TriangleMesh) else 1e-3
    assert 20 < free.sum() < 395
    for q, is_free in zip(states, free, strict=True):
        state = scene.state.with_q(q, rod.groups["g"].indices)
        if is_free:
            assert exact.free(scene, state)
        else:
            assert exact.distance(scene, state) <= beyond


@pytest.fixture(scope="module")
def spheres(baxter, meshes):
    return SphereModel.of(baxter, meshes)


@pytest.fixture(scope="module")
def exact(baxter, meshes):
    return ExactChecker(baxter, meshes)


@pytest.fixture(scope="module")
def cluttered(baxter):
    """Baxter at a table with a post. Shapes of links near each other overlap in the description: these may touch."""
    table = WorldObject("table", pose((0.8, 0.0, -0.3)), ((Box((0.6, 1.4, 0.04)), np.eye(4)),))
    post = WorldObject("post", pose((0.7, 0.2, 0.1)), ((Cylinder(0.05, 0.8), np.eye(4)),))
    scene, near = Scene(baxter), {}
    for side in ("left", "right"):
        arm = baxter.groups[side + "_arm"].moving_links
        body = [link for link in baxter.links if link not in baxter.groups["both_arms"].moving_links]
        near.update(dict.fromkeys(itertools.combinations(arm, 2), True))
        upper = [link for link in arm if "shoulder" in link or "upper_elbow" in link]
        near.update(dict.fromkeys(itertools.product(upper, body), True))
    return scene.with_allowed(scene.allowed.with_entries(near)).with_objects([table, post])


@pytest.mark.parametrize("group", ["left_arm", "right_arm", "both_arms"])
def test_free_by_spheres_is_free_by_exact_geometry(baxter, cluttered, spheres, exact, group):
    """And what is free with room to spare is free by spheres."""
    scene, own = cluttered, baxter.groups[group]
    checker = SphereChecker(spheres, own, scene)
    states = np.random.default_rng(6).uniform(*baxter.bounds[own.indices].T, (400, len(own)))
    free = checker.valid(states)
    assert 10 < free.sum() < 390
    wrong, far = [], []
    for q, is_free in zip(states, free, strict=True):
        state = scene.state.with_q(q, own.indices)
        by_exact = exact.free(scene, state, group)
        if is_free and not by_exact:
            wrong.append(exact.contacts(scene, state, group))
        if by_exact and not is_free and exact.distance(scene, state, group) > 0.035:
            far.append(exact.nearest(scene, state, group))
    assert wrong == []
    assert far == []


def test_an_edge_is_what_its_states_are(baxter, cluttered, spheres):
    own = baxter.groups["left_arm"]
    checker = SphereChecker(spheres, own, cluttered)
    rng = np.random.default_rng(7)
    for _ in range(60):
        a, b = rng.uniform(*baxter.bounds[own.indices].T, (2, len(own)))
        b = a + (b - a) * rng.uniform(0.05, 1.0)
        count = 16 * max(1, int(np.ceil(np.linalg.norm(b - a) / (16.0 * checker.resolution))))
        states = a + (b - a) * np.arange(1, count + 1)[:, None] / count
        assert checker.edge(a, b) == checker.valid(states).all()
    points = rng.uniform(*baxter.bounds[own.indices].T, (40, len(own)))
    points[1::2] = points[::2] + rng.uniform(-0.1, 0.1, (20, len(own)))
    free = checker.edges(points)
    assert free.tolist() == [checker.edge(a, b) for a, b in itertools.pairwise(points)]
    assert free.any() and not free.all()
    assert checker.edges(points, ~free).all(), "those that are known to be free are not checked"
    first = int(np.flatnonzero(~free)[0])
    assert checker.way(points[: first + 1]) and not checker.way(points)


def test_no_states_and_one(baxter, cluttered, spheres):
    own = baxter.groups["left_arm"]
    checker = SphereChecker(spheres, own, cluttered)
    assert checker.valid(np.empty((0, len(own)))).shape == (0,)
    assert checker.valid(np.zeros(len(own))).shape == (1,)


def test_what_is_held_counts_and_may_touch_what_it_may(baxter, cluttered, spheres):
    own = baxter.groups["left_arm"]
    stick = WorldObject("stick", pose((0.0, 0.0, 0.3)), ((Cylinder(0.01, 0.4), np.eye(4)),))
    wall = WorldObject("wall", pose((1.6, 0.0, 0.0)), ((Box((0.1, 4.0, 4.0)), np.eye(4)),))
    scene = cluttered.without_object("").with_object(wall)
    q = np.zeros(len(own))
    tip = baxter.frame_of(scene.state.with_q(q, own.indices).q, "left_gripper")
    scene = scene.moved("wall", pose(tip[:3, 3] + 0.3 * tip[:3, 2]))
    free = SphereChecker(spheres, own, scene).valid(q)[0]
    held = scene.attach(stick, "left_gripper", ("left_hand", "left_gripper_base"))
    assert free and not SphereChecker(spheres, own, held).valid(q)[0]
    allowed = held.with_allowed(held.allowed.with_entries({("stick", "wall"): True}))
    assert SphereChecker(spheres, own, allowed).valid(q)[0]


def test_padding_makes_links_larger(rod):
    scene = Scene(rod).with_object(WorldObject("box", pose((0.5, 0.0, 0.0)), ((Box((0.2, 0.2, 0.2)), np.eye(4)),)))
    model, group = SphereModel.of(rod, None), rod.groups["g"]
    q = [0.2, 0.0, 0.0]  # 0.1 m from the box
    assert SphereChecker(model, group, scene).valid(q)[0]
    assert not SphereChecker(model, group, scene.with_padding({"ball": 0.11})).valid(q)[0]
    assert not SphereChecker(model, group, scene.with_padding({}, {"ball": 2.1})).valid(q)[0]


def test_tables_are_made_once_for_scenes_that_differ_in_the_groups_joints_alone(baxter, cluttered, spheres):
    own = baxter.groups["left_arm"]
    tables = SphereChecker(spheres, own, cluttered).tables
    moved = cluttered.with_state(cluttered.state.with_q(np.full(len(own), 0.3), own.indices))
    assert SphereChecker(spheres, own, moved).tables is tables
    right = baxter.groups["right_arm"]
    away = cluttered.with_state(cluttered.state.with_q(np.full(len(right), 0.3), right.indices))
    fewer = cluttered.without_object(next(iter(cluttered.objects)))
    free = cluttered.with_allowed(cluttered.allowed.with_entries({("left_gripper", "right_gripper"): True}))
    for other in (away, fewer, free):
        assert SphereChecker(spheres, own, other).tables is not tables


def test_a_tree_leads_past_everything_to_each_of_its_objects():
    rng = np.random.default_rng(8)
    parts = [(Box(tuple(rng.uniform(0.1, 0.5, 3))), pose(rng.normal(size=3))) for _ in range(23)]
    (links, nodes, kinds, _), places = forest([tree_of(solids_of(parts[:20])), tree_of(solids_of(parts[20:]))])
    links, nodes = links.reshape(-1, 2), nodes.reshape(-1, 6)
    assert len(kinds) == 23 and places == [(0, 39), (39, 44)]
    for begin, end in places:
        for node in range(begin, end):
            below, skip = range(node + 1, links[node, 0]), links[node, 0]
            assert node < skip <= end
            assert (nodes[list(below), :3] >= nodes[node, :3]).all()
            assert (nodes[list(below), 3:] <= nodes[node, 3:]).all()
    assert sorted(links[links[:, 1] >= 0, 1]) == list(range(23))


def test_a_scene_without_time_is_coarse_and_gets_better_with_the_next_request():
    """Spheres that were made in a hurry are not kept."""
    model = PlanningModel.from_xml(ROD, "<robot name='rod'><group name='g'><chain base_link='base' tip_link='ball'/>"
                                        "</group></robot>")
    spheres, group = SphereModel.of(model, None), model.groups["g"]
    ring = TriangleMesh([(x, y, z) for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)) for z in (-0.1, 0.1)],
                        [(k % 8, (k + 1) % 8, (k + 2) % 8) for k in range(8)])
    scene = Scene(model).with_object(WorldObject("ring", np.eye(4), ((ring, np.eye(4)),)))
    hurried = SphereChecker(spheres, group, scene, patience=Patience(late=lambda: True))
    assert "ring" in hurried.remarks[0]
    patient = SphereChecker(spheres, group, scene)
    assert patient.remarks == () and len(patient.tables[1][0]) > len(hurried.tables[1][0])

    def ended():
        raise KeyError("stopped")

    other = scene.with_object(WorldObject("ring", pose((0.1, 0.0, 0.0)), ((ring, np.eye(4)),)))
    with pytest.raises(KeyError):
        SphereChecker(spheres, group, other, patience=Patience(check=ended))


@pytest.mark.parametrize("link", ['<box size="0.2 0.2 0.2"/>', '<cylinder radius="0.1" length="0.2"/>'])
@pytest.mark.parametrize(("padding", "scale"), [(0.1, 1.0), (0.0, 0.5), (0.05, 0.8), (0.0, 1.5)])
def test_spheres_contain_a_link_that_is_padded_or_scaled(link, padding, scale):
    """A padded box has corners; a link of half the size is no thinner than its spheres."""
    model = PlanningModel.from_xml(ROD.replace('<sphere radius="0.1"/>', link), "<robot name='rod'><group name='g'>"
                                   "<chain base_link='base' tip_link='ball'/></group></robot>")
    scene = Scene(model).with_padding({"ball": padding}, {"ball": scale}).with_object(
        WorldObject("tip", np.eye(4), ((Sphere(0.005), np.eye(4)),)))
    exact, checker = ExactChecker(model, None), SphereChecker(SphereModel.of(model, None), model.groups["g"], scene)
    states = np.random.default_rng(1).uniform(-0.3, 0.3, (400, 3))
    free = states[checker.valid(states)]
    assert len(free) and exact.first_blocked(scene, free, "g") is None


def test_balls_of_a_robots_tables_cost_little():
    """They are made again when another joint has moved, also between an obstacle's message and the way around it."""
    spheres = np.column_stack([np.random.default_rng(5).normal(size=(100, 3)), np.full(100, 0.1)])
    ball(spheres, steps=12)  # compiles
    begin = time.thread_time()
    for _ in range(300):
        ball(spheres, steps=12)
    assert time.thread_time() - begin < MAX_BALLS_S
