# SPDX-License-Identifier: BSD-3-Clause
"""Contacts, their places and depths: exact checks against what can be told without one, and against PyBullet."""
import math

import numpy as np
import pybullet
import pytest

from motion_planning.exact import ExactChecker, apart
from motion_planning.exact.geometry import bounds_of, fcl_geometry, plane_overlap
from motion_planning.exact.tables import Geometries
from motion_planning.model import MeshUnreadable, ModelError, PlanningModel
from motion_planning.scene import OCTOMAP, AllowedCollisions, Cone, Octree, Scene, TriangleMesh, WorldObject
from urdf_model import Box, Cylinder, Plane, Sphere
from urdf_model.transforms import axis_rotation, quaternion_from_matrix, rigid

# Something with a shape that slides along x, and a finger that slides along y on top of it.
SLIDER = """<robot name="slider"><link name="base"/>
  <link name="car"><collision><geometry>%s</geometry></collision></link>
  <link name="finger"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="x" type="prismatic"><parent link="base"/><child link="car"/><axis xyz="1 0 0"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/></joint>
  <joint name="y" type="prismatic"><origin xyz="0 0 2"/><parent link="car"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/></joint></robot>"""
SEMANTIC = """<robot name="slider"><group name="car"><joint name="x"/></group><group name="finger"><joint name="y"/>
  </group></robot>"""
# A ball at the end of a rod of 1 m, which turns without end.
TURNING = """<robot name="turning"><link name="base"/>
  <link name="rod"><collision><origin xyz="1 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/></joint></robot>"""
CORNERS = np.array([(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CUBE = TriangleMesh(CORNERS, [corners for a, b, c, d in SIDES for corners in ((a, b, c), (a, c, d))])
# All of them reach 0.1 m along x.
SHAPES = {"box": Box((0.2, 0.2, 0.2)), "sphere": Sphere(0.1), "cylinder": Cylinder(0.1, 0.2), "mesh": CUBE,
          "octree": Octree(0.1, [(x, y, z, 0.1) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)])}
XML = {"box": '<box size="0.2 0.2 0.2"/>', "sphere": '<sphere radius="0.1"/>', "mesh": '<mesh filename="cube"/>',
       "cylinder": '<cylinder radius="0.1" length="0.2"/>'}


def at(x=0.0, y=0.0, z=0.0):
    return rigid(np.eye(3), (x, y, z))


def thing(shape, x=0.0, y=0.0, z=0.0, name="thing"):
    return WorldObject(name, at(x, y, z), ((shape, np.eye(4)),))


def slider(kind="box"):
    model = PlanningModel.from_xml(SLIDER % XML[kind], SEMANTIC)
    return Scene(model), ExactChecker(model, {"cube": CUBE}.__getitem__)


@pytest.mark.parametrize("mine", XML)
@pytest.mark.parametrize("other", SHAPES)
def test_contacts_of_each_two_shapes(mine, other):
    scene, exact = slider(mine)
    # A little to the side: exactly aligned faces have no one right answer.
    scene = scene.with_object(thing(SHAPES[other], 1.0, 0.003, 0.002))
    apart = scene.state.with_joints({"x": 0.79})
    assert exact.free(scene, apart) and exact.contacts(scene, apart) == []
    assert exact.distance(scene, apart) == pytest.approx(0.01, abs=1e-3)
    for x, sign in ((0.81, 1.0), (1.19, -1.0)):
        state = scene.state.with_joints({"x": x})
        assert not exact.free(scene, state) and exact.distance(scene, state) == 0.0
        (contact,) = exact.contacts(scene, state)
        assert (contact.a, contact.b, contact.a_kind, contact.b_kind) == ("car", "thing", "robot", "object")
        assert sign * contact.point[0] == pytest.approx(sign * (1.0 - sign * 0.1), abs=0.02)
        assert np.linalg.norm(contact.normal) == pytest.approx(1.0)
        if (mine, other) != ("mesh", "mesh"):  # what FCL says of two triangles is theirs alone
            assert sign * contact.normal[0] > 0.9
            assert contact.depth == pytest.approx(0.01, abs=2e-3)


def test_cones():
    scene, exact = slider("box")
    scene = scene.with_object(thing(Cone(0.1, 0.4), 1.0))
    # Its base is 0.2 m below its middle; at the height of the car's top it is half that of the base wide.
    assert exact.free(scene, scene.state.with_joints({"x": 0.82}))
    assert not exact.free(scene, scene.state.with_joints({"x": 0.84}))
    assert exact.free(scene, scene.state.with_joints({"x": 1.18}))


def test_words_of_a_contact():
    scene, exact = slider()
    (contact,) = exact.contacts(scene.with_object(thing(SHAPES["box"], 0.19)))
    assert str(contact) == "link 'car' and object 'thing' overlap by 0.0100 m"


def test_planes_have_no_thickness_and_no_end():
    scene, exact = slider()
    for height, free in ((-0.101, True), (-0.099, False), (0.099, False), (0.101, True), (1.94, True), (1.96, False)):
        floor = scene.with_object(thing(Plane(), z=height))
        assert exact.free(floor) is free
        assert (exact.distance(floor) == 0.0) is not free
    contacts = exact.contacts(scene.with_object(thing(Plane(), z=-0.09)))
    assert [(one.a, one.b) for one in contacts] == [("car", "thing")]
    np.testing.assert_allclose(contacts[0].normal, (0.0, 0.0, -1.0))
    np.testing.assert_allclose(contacts[0].point, (0.0, 0.0, -0.09))
    assert contacts[0].depth == pytest.approx(0.01)
    wall = WorldObject("wall", rigid(axis_rotation((0.0, 1.0, 0.0), math.pi / 2), (0.15, 0, 0)),
                       ((Plane(), np.eye(4)),))
    assert exact.nearest(scene.with_object(wall)).distance == pytest.approx(0.05)
    assert not exact.free(scene.with_object(wall), scene.state.with_joints({"x": 0.06}))


@pytest.mark.parametrize("shape, reach", [(Sphere(0.1), 0.1), (Cylinder(0.05, 0.2), 0.1), (Cone(0.05, 0.2), 0.1),
                                          (CUBE, 0.1), (Box((0.1, 0.1, 0.2)), 0.1)])
def test_what_is_held_meets_planes(shape, reach):
    scene, exact = slider()
    held = scene.attach(thing(shape, z=-1.0, name="held"), "car")
    for height, free in ((-1.0 - reach - 1e-3, True), (-1.0 - reach + 1e-3, False), (-1.0 + reach + 1e-3, True)):
        assert exact.free(held.with_object(thing(Plane(), z=height))) is free


def test_a_vertex_of_no_triangle_meets_no_plane():
    mesh = TriangleMesh([*CUBE.vertices, (0.0, 0.0, 9.0)], CUBE.triangles)
    assert plane_overlap(at(z=0.15), mesh, np.eye(4)) == pytest.approx(-0.05)


def test_triangles_without_area_are_the_lines_and_points_that_they_are():
    source = np.random.default_rng(3)
    scene, exact = slider("sphere")
    wrong = []
    for number in range(300):
        a, b = source.normal(size=(2, 3)) * 0.2
        between = a + source.uniform() * (b - a)
        corners = ((a, a, b), (a, b, a), (a, between, b), (a, a, a))[number % 4]
        points = a + np.linspace(0.0, 1.0, 2001)[:, None] * (np.zeros(3) if number % 4 == 3 else b - a)
        gap = np.linalg.norm(points, axis=1).min() - 0.1
        mesh = WorldObject("thing", at(), ((TriangleMesh(corners, [(0, 1, 2)]), np.eye(4)),))
        if abs(gap) > 1e-4 and exact.free(scene.with_object(mesh)) != (gap > 0.0):
            wrong.append((number, gap))
    assert wrong == []


def test_cubes_of_an_octomap_are_solid():
    scene, exact = slider("sphere")
    full = scene.with_octomap(Octree(0.05, [(2.4, 0.8, 0.8, 1.6), (-0.975, 0.025, 0.025, 0.05)]), at())
    answers = {x: exact.free(full, full.state.with_joints({"x": x}))
               for x in (-1.11, -1.08, -0.97, -0.5, 1.49, 1.51, 2.4, 3.29, 3.31)}
    assert [x for x, free in answers.items() if not free] == [-1.08, -0.97, 1.51, 2.4, 3.29]
    (contact,) = exact.contacts(full, full.state.with_joints({"x": 1.51}))
    assert contact.b == OCTOMAP
    allowed = full.with_allowed(full.allowed.with_entries({("car", OCTOMAP): True}))
    assert exact.free(allowed, full.state.with_joints({"x": 2.4}))


@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder", "mesh"])
def test_an_octomap_is_what_its_cubes_are(kind):
    """Cubes of several sizes, one in another, against boxes of the same sizes at the same places."""
    cubes = [(0.05, 0.05, 0.05, 0.1), (0.4, 0.4, 0.4, 0.8), (-0.05, 0.15, 0.05, 0.1), (-0.3, -0.1, 0.1, 0.2)]
    scene, exact = slider(kind)
    generator = np.random.default_rng(3)
    touching = 0
    for _ in range(200):
        turn = axis_rotation((0.6, 0.0, 0.8), generator.uniform(-3.0, 3.0))
        frame = rigid(turn, generator.uniform(-0.6, 0.6, 3))
        boxes = scene.with_objects([WorldObject("b%d" % k, frame @ at(*cube[:3]), ((Box(3 * cube[3:]), np.eye(4)),))
                                    for k, cube in enumerate(cubes)])
        octomap = scene.with_octomap(Octree(0.1, cubes), frame)
        if 1e-3 < exact.distance(boxes, group="car") or exact.contacts(boxes, group="car") and max(
                contact.depth for contact in exact.contacts(boxes, group="car")) > 1e-3:
            free = exact.free(boxes, group="car")
            touching += not free
            assert exact.free(octomap, group="car") is free
            assert (exact.contacts(octomap, group="car") == []) is free
    assert 20 < touching < 180


def test_an_octomap_without_a_cube_is_free():
    scene, exact = slider()
    assert exact.free(scene.with_octomap(Octree(0.1, [])))


def test_what_is_held_moves_along_and_may_touch_who_holds_it():
    scene, exact = slider()
    held = scene.with_objects([thing(Sphere(0.15), z=0.2, name="cup"), thing(Box((0.2, 0.2, 0.2)), 3.0, z=0.3)])
    assert [(one.a, one.b) for one in exact.contacts(held)] == [("car", "cup")]
    held = held.attach("cup", "car")
    assert exact.contacts(held) == []
    (contact,) = exact.contacts(held, held.state.with_joints({"x": 2.8}))
    assert (contact.a, contact.b, contact.a_kind, contact.b_kind) == ("cup", "thing", "attached", "object")
    # Another link may not touch it unless it is said so, and two things in the same hand may touch.
    finger = held.attach(thing(Sphere(0.08), z=-1.8, name="ball"), "finger")
    assert {frozenset((one.a, one.b)) for one in exact.contacts(finger)} == {frozenset(("cup", "ball"))}
    handed = finger.attach("ball", "car")
    assert exact.contacts(handed) == []
    low = thing(Sphere(0.05), z=-1.95, name="ball")
    assert [(one.a, one.b) for one in exact.contacts(scene.attach(low, "finger"))] == [("car", "ball")]
    assert exact.free(scene.attach(low, "finger", ["car"]))


def test_what_may_touch_is_left_out():
    scene, exact = slider()
    touching = scene.with_object(thing(SHAPES["box"], 0.1))
    said = touching.allowed
    for allowed in (said.with_entries({("thing", "car"): True}), said.with_default("thing", True),
                    said.with_default("car", True)):
        assert exact.free(touching.with_allowed(allowed))
        assert exact.distance(touching.with_allowed(allowed)) > 1.0
    assert not exact.free(touching)


def test_a_group_is_checked_without_what_does_not_move_with_it():
    scene, exact = slider()
    touching = scene.with_object(thing(SHAPES["box"], 0.1))
    assert not exact.free(touching, group="car") and exact.free(touching, group="finger")
    with pytest.raises(ModelError, match="no group 'leg'"):
        exact.free(touching, group="leg")


def test_padding_and_scale_of_links():
    scene, exact = slider()
    near = scene.with_object(thing(SHAPES["box"], 0.21))
    assert exact.free(near)
    assert not exact.free(near.with_padding({"car": 0.02})) and not exact.free(near.with_padding({}, {"car": 1.2}))
    assert exact.free(near.with_padding({"finger": 0.02}, {"finger": 1.2}))
    for kind in ("mesh", "sphere", "cylinder"):
        scene, exact = slider(kind)
        near = scene.with_object(thing(SHAPES["box"], 0.21))
        assert exact.free(near) and not exact.free(near.with_padding({"car": 0.02}))


def test_states_that_are_none():
    scene, exact = slider()
    with pytest.raises(ModelError, match="not all finite"):
        exact.free(scene, scene.state.with_q([math.nan, 0.0]))
    with pytest.raises(ModelError, match="pose of link 'base' is not finite"):
        exact.free(scene, scene.state.with_base(at(math.nan)))
    with pytest.raises(ModelError, match="expected 2 joint values"):
        exact.free(scene, scene.state.with_q([0.0]))


def test_the_first_of_many_postures_that_touches(baxter, meshes):
    scene, exact = slider()
    scene = scene.with_object(thing(SHAPES["box"], 1.0))
    ways = np.linspace(0.0, 2.0, 21)[:, None]  # it touches from 0.8 to 1.2
    assert exact.first_blocked(scene, ways, "car") in (8, 9)
    assert exact.first_blocked(scene, ways[:8], "car") is None
    assert exact.first_blocked(scene, np.hstack([ways, 0.0 * ways])) in (8, 9)
    assert exact.first_blocked(scene, np.empty((0, 2))) is None
    assert exact.first_blocked(scene, np.hstack([ways, ways]), "finger") is None
    for bad, words in ((np.zeros((3, 5)), "postures of 1 joints"), (np.zeros(3), "postures of 1"),
                       ([[0.0], [math.nan]], "posture 1")):
        with pytest.raises(ModelError, match=words):
            exact.first_blocked(scene, bad, "car")
    # Whatever was asked before, as if each was asked alone.
    exact, scene = ExactChecker(baxter, meshes), Scene(baxter)
    generator = np.random.default_rng(9)
    scene = scene.with_allowed(scene.allowed.with_entries({
        (a, b): True for k, a in enumerate(baxter.links) for b in baxter.links[:k]})).with_objects(
        [thing(Box((0.1, 0.1, 0.1)), *generator.uniform(-1.2, 1.2, 3), name="box%d" % k) for k in range(30)])
    scene = scene.with_allowed(scene.allowed.with_entries({
        (contact.a, contact.b): True for contact in exact.contacts(scene, most=10_000)}))
    postures = generator.uniform(*baxter.bounds.T, (300, len(baxter.variables)))
    for group in (None, "left_arm"):
        free = np.array([exact.free(scene, scene.state.with_q(q), group) for q in postures])
        assert 50 < free.sum() < 250
        assert exact.first_blocked(scene, postures[free], group) is None
        for blocked in postures[~free][:20]:
            assert exact.first_blocked(scene, np.vstack([postures[free][:50], blocked]), group) == 50


def test_the_number_of_contacts_is_bounded():
    scene, exact = slider()
    many = scene.with_objects([thing(Sphere(0.05), 0.001 * k, name="ball%d" % k) for k in range(60)])
    assert len(exact.contacts(many)) == 60 and len(exact.contacts(many, most=7)) == 7


def test_one_of_many_thousand_is_found():
    scene, exact = slider()
    generator = np.random.default_rng(1)
    places = generator.uniform(-3.0, 3.0, (5_000, 3))
    places[np.linalg.norm(places, axis=1) < 0.5] += 5.0
    crowd = scene.with_objects([thing(Box((0.01, 0.01, 0.01)), *place, name="b%d" % k)
                                for k, place in enumerate(places)])
    crowd = crowd.with_objects([thing(Box((8.0, 8.0, 0.01)), z=-4.0, name="table")])
    hit = crowd.with_object(thing(Box((0.01, 0.01, 0.01)), 0.1, name="needle"))
    assert [one.b for one in exact.contacts(crowd, group="car")] == [
        "b%d" % k for k, place in enumerate(places) if (np.abs(place) < 0.105).all()]
    assert "needle" in [one.b for one in exact.contacts(hit)]


def test_a_mesh_that_cannot_be_read_is_a_warning():
    def unreadable(name):
        raise MeshUnreadable("mesh %s is not there" % name)

    model = PlanningModel.from_xml(SLIDER % XML["mesh"], SEMANTIC)
    exact = ExactChecker(model, unreadable)
    assert exact.warnings == ["mesh cube is not there; link 'car' is checked without it"]
    assert exact.free(Scene(model).with_object(thing(SHAPES["box"])))


# -- against code that shares nothing with it ---------------------------------------------------------------------

MARGIN = 2e-3  # [m]; Bullet rounds its cylinders


@pytest.fixture(scope="module")
def bullet():
    client = pybullet.connect(pybullet.DIRECT)
    yield client
    pybullet.disconnect(client)


def bullet_body(shape, client):
    if isinstance(shape, Box):
        made = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.5 * side for side in shape.size],
                                             physicsClientId=client)
    elif isinstance(shape, Sphere):
        made = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=shape.radius, physicsClientId=client)
    else:
        made = pybullet.createCollisionShape(pybullet.GEOM_CYLINDER, radius=shape.radius, height=shape.length,
                                             physicsClientId=client)
    return pybullet.createMultiBody(1.0, made, physicsClientId=client)


def bullet_distances(shapes, poses, client):
    """{(i, j): Bullet's distance [m]} of all pairs nearer than 5 cm."""
    bodies = [bullet_body(shape, client) for shape in shapes]
    for body, pose in zip(bodies, poses, strict=True):
        pybullet.resetBasePositionAndOrientation(body, pose[:3, 3], quaternion_from_matrix(pose),
                                                 physicsClientId=client)
    found = {}
    for i, a in enumerate(bodies):
        for j, b in enumerate(bodies[:i]):
            points = pybullet.getClosestPoints(a, b, 0.05, physicsClientId=client)
            if points:
                found[j, i] = min(point[8] for point in points)
    for body in bodies:
        pybullet.removeBody(body, physicsClientId=client)
    return found


@pytest.mark.parametrize("name, states, least", [("baxter", 25, 300), ("probot", 200, 5)])
def test_pybullet_agrees_about_robots(name, states, least, request, meshes, bullet):
    """Every pair of shapes but Baxter's two meshes, at random postures, whatever the SRDF says of it."""
    model = request.getfixturevalue(name)
    exact = ExactChecker(model, meshes)
    generator = np.random.default_rng(7)
    scene = Scene(model, allowed=AllowedCollisions())
    links = [(name, shape) for name in model.links for shape in model.robot.links[name].collisions
             if isinstance(shape.geometry, Box | Sphere | Cylinder)]
    compared = touching = 0
    for q in generator.uniform(*model.bounds.T, (states, len(model.variables))):
        state = scene.state.with_q(q)
        ours = {tuple(sorted((one.a, one.b))) for one in exact.contacts(scene, state, most=10_000)}
        frames = model.frames(q)
        distances = bullet_distances([shape.geometry for _, shape in links],
                                     [frames[model.link_index[name]] @ shape.origin for name, shape in links], bullet)
        theirs = {}
        for (i, j), distance in distances.items():
            pair = tuple(sorted((links[i][0], links[j][0])))
            theirs[pair] = min(distance, theirs.get(pair, math.inf))
        for pair, distance in theirs.items():
            if pair[0] != pair[1] and abs(distance) > MARGIN:
                assert (pair in ours) == (distance < 0.0), (pair, distance, q)
                compared, touching = compared + 1, touching + (distance < 0.0)
        only_ours = [pair for pair in ours if pair not in theirs and not {"torso", "pedestal"} & set(pair)]
        assert only_ours == [], q
    assert touching > least and compared - touching > least // 3, (touching, compared)


@pytest.mark.parametrize("mine", ["box", "sphere", "cylinder"])
@pytest.mark.parametrize("other", ["box", "sphere", "cylinder"])
def test_pybullet_agrees_about_distances(mine, other, bullet):
    scene, exact = slider(mine)
    generator = np.random.default_rng(11)
    for _ in range(40):
        turn = axis_rotation((lambda v: v / np.linalg.norm(v))(generator.normal(size=3)), generator.uniform(0.0, 3.0))
        pose = rigid(turn, generator.uniform(-0.3, 0.3, 3))
        placed = scene.with_object(WorldObject("thing", pose, ((SHAPES[other], np.eye(4)),)))
        nearest = exact.nearest(placed, group="car")
        distance = bullet_distances([SHAPES[mine], SHAPES[other]], [np.eye(4), pose], bullet).get((0, 1))
        if distance is None:
            assert nearest.distance > 0.05 - MARGIN
        elif distance < 0.0:
            assert nearest.distance < MARGIN
        else:
            assert nearest.distance == pytest.approx(distance, abs=MARGIN)
            assert np.linalg.norm(nearest.point_a - nearest.point_b) == pytest.approx(nearest.distance, abs=1e-4)


def test_the_quick_way_finds_what_a_check_of_every_pair_finds(baxter, meshes):
    """Nothing near is sorted out: balls and boxes against FCL alone."""
    import fcl

    exact = ExactChecker(baxter, meshes)
    scene = Scene(baxter)
    generator = np.random.default_rng(5)
    for q in generator.uniform(*baxter.bounds.T, (15, len(baxter.variables))):
        state = scene.state.with_q(q)
        frames = baxter.frames(q)
        objects = [(part, fcl.CollisionObject(geometry, fcl.Transform(pose[:3, :3], pose[:3, 3])))
                   for part, geometry in zip(exact._movers(scene, state).parts, exact._movers(scene, state).geometries,
                                             strict=True)
                   for pose in [frames[part.link] @ part.pose]]
        expected = {(a.name, b.name) for j, (b, second) in enumerate(objects) for a, first in objects[:j]
                    if a.name != b.name and fcl.collide(first, second)}
        assert {(one.a, one.b) for one in exact.contacts(scene, state, most=10_000)} == expected


@pytest.mark.parametrize("away", [0.0, 5e4])
@pytest.mark.parametrize("side", [0.2, 8e4])
def test_no_posture_that_touches_is_passed_over_where_numbers_are_large(away, side):
    """Single floats have steps of 4 mm there."""
    scene, exact = slider("sphere")
    scene = scene.with_state(scene.state.with_base(at(away, -away))).with_object(
        thing(Box((side, side, side)), away + 0.405 + 0.5 * side, -away))
    positions = np.column_stack([np.linspace(0.2805, 0.3195, 40), np.zeros(40)])
    found = [exact.first_blocked(scene, q[None]) is not None for q in positions]
    assert found == (positions[:, 0] > 0.305).tolist()
    assert exact.first_blocked(scene, positions) == found.index(True)


def test_turns_without_end_are_known_to_the_last_bit():
    """A joint that turned a million times is where it is, though single floats do not tell."""
    model = PlanningModel.from_xml(TURNING, "<robot name='turning'/>")
    exact, scene = ExactChecker(model, {}.__getitem__), Scene(model).with_object(thing(Sphere(0.1), 1.0))
    for turns in (0, 1_000_000, -1_000_000):
        for angle in np.linspace(-3.0, 3.0, 61):
            q = 2.0 * math.pi * turns + angle
            blocked = exact.first_blocked(scene, np.full((3, 1), q)) is not None
            assert blocked == (2.0 * abs(math.sin(0.5 * angle)) < 0.2), (turns, angle)


def ball_of_triangles(radius, around=12):
    """A TriangleMesh of a sphere."""
    height, turn = np.meshgrid(np.linspace(0.0, math.pi, around), np.linspace(0.0, 2.0 * math.pi, 2 * around))
    points = radius * np.stack([np.sin(height) * np.cos(turn), np.sin(height) * np.sin(turn), np.cos(height)], axis=-1)
    k = np.arange(len(points.reshape(-1, 3))).reshape(points.shape[:2])
    squares = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    return TriangleMesh(points.reshape(-1, 3), np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]]))


MANY = {"box": Box((0.3, 0.1, 0.2)), "sphere": Sphere(0.15), "cylinder": Cylinder(0.08, 0.4), "cone": Cone(0.15, 0.3),
        "mesh": ball_of_triangles(0.2), "octree": SHAPES["octree"]}


@pytest.mark.parametrize("mine", MANY)
@pytest.mark.parametrize("other", MANY)
def test_a_proof_is_right_and_found_where_there_is_room(mine, other):
    import fcl

    rng = np.random.default_rng(3)
    stack = apart.stack()
    forms, fcl_shapes, bounds = [], [], []
    for shape in (MANY[mine], MANY[other]):
        bounds.append(bounds_of(shape))
        forms.append(Geometries().tables([shape])[3])
        fcl_shapes.append(fcl_geometry(shape))
    proven = needed = 0
    for _ in range(400):
        turns = [axis_rotation(axis / np.linalg.norm(axis), angle)
                 for axis, angle in zip(rng.normal(size=(2, 3)), rng.uniform(-3.0, 3.0, 2), strict=True)]
        places = [rng.uniform(-0.3, 0.3, 3) for _ in range(2)]
        there = [fcl.CollisionObject(shape, fcl.Transform(turn, place))
                 for shape, turn, place in zip(fcl_shapes, turns, places, strict=True)]
        centres = [place + turn @ bound.centre for place, turn, bound in zip(places, turns, bounds, strict=True)]
        found = apart.pair_apart(forms[0], (0, turns[0], centres[0]), forms[1], (0, turns[1], centres[1]), stack)
        touch = fcl.collide(*there)
        assert not (found and touch)
        if not touch and fcl.distance(*there) > 0.02:
            needed += 1
            proven += found
    # A tree of boxes is not searched for longer than FCL would take.
    assert needed > 20 and proven >= 0.6 * needed


def test_what_is_clearly_apart_is_not_asked_about(monkeypatch):
    """A rod on end beside a corner of a box: the boxes around the two overlap."""
    scene, exact = slider("cylinder")
    scene = scene.with_object(thing(Box((0.2, 0.2, 0.2)), 0.19, 0.19))
    assert exact.distance(scene) == pytest.approx(math.hypot(0.09, 0.09) - 0.1, abs=1e-4)
    monkeypatch.setattr(exact, "_touches", lambda *pair: pytest.fail("FCL was asked about %s" % (pair[1:],)))
    assert exact.free(scene)
    assert exact.first_blocked(scene, np.tile(scene.state.q, (100, 1))) is None
