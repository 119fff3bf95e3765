# SPDX-License-Identifier: BSD-3-Clause
"""Paths: free by geometry that shares nothing with the planner, from start to goal, the same for the same seed."""
import itertools
import math
import subprocess
import sys
import time

import numpy as np
import pybullet
import pytest

from motion_planning.exact import ExactChecker
from motion_planning.model import PlanningModel
from motion_planning.planners import NoPath, SearchOptions, TreeSearch, parts, plan_path, rrt_connect, shorten
from motion_planning.planners.parts import _synchronized
from motion_planning.planners.planning import sphere_model_of
from motion_planning.planners.trees import growing
from motion_planning.scene import Scene, WorldObject
from motion_planning.spheres import SphereChecker, SphereModel
from urdf_model import Box, Cylinder
from urdf_model.transforms import pose_matrix as pose

# As long as a slow machine may need: what is tested is the answer.
PATIENCE_S = 60.0

LINKS = "".join("""<link name="l%d"><collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.06 0.06"/></geometry>
</collision></link>""" % k for k in range(4))
JOINTS = "".join("""<joint name="j%d" type="revolute"><origin xyz="%s 0 0"/><parent link="%s"/><child link="l%d"/>
<axis xyz="0 %d %d"/><limit lower="-2.8" upper="2.8" effort="1" velocity="1"/></joint>"""
                 % (k, 0.4 if k else 0.0, "l%d" % (k - 1) if k else "base", k, k % 2, 1 - k % 2) for k in range(4))
SNAKE = "<robot name='snake'><link name='base'/>%s%s</robot>" % (LINKS, JOINTS)
SNAKE_SRDF = "<robot name='snake'><group name='arm'>%s</group>%s</robot>" % (
    "".join("<joint name='j%d'/>" % k for k in range(4)),
    "".join("<disable_collisions link1='l%d' link2='l%d' reason='Adjacent'/>" % (k, k + 1) for k in range(3)))


@pytest.fixture(scope="module")
def snake():
    return PlanningModel.from_xml(SNAKE, SNAKE_SRDF)


@pytest.fixture(scope="module")
def exact(snake):
    return ExactChecker(snake, None)


def search(exact, seed=1, allowed_time=PATIENCE_S, **more):
    return SearchOptions(exact, seed, allowed_time, time.monotonic, **more)


def patient(exact, seed, looks=60):
    """A SearchOptions whose time is the number of looks at the clock: as patient on any machine."""
    return SearchOptions(exact, seed, looks, itertools.count().__next__)


def clutter(model, seed, count=5):
    rng = np.random.default_rng(seed)
    return Scene(model).with_objects([
        WorldObject("thing%d" % k, pose(rng.uniform(-1.2, 1.2, 3), rng.uniform(-3.0, 3.0, 3)),
                    ((box if k % 2 else rod, np.eye(4)),))
        for k in range(count) for box in [Box(tuple(rng.uniform(0.1, 0.4, 3)))]
        for rod in [Cylinder(*rng.uniform(0.05, 0.4, 2))]])


def free_postures(exact, scene, group, rng, count):
    found = []
    while len(found) < count:
        q = rng.uniform(*scene.model.bounds[group.indices].T)
        if exact.free(scene, scene.state.with_q(q, group.indices), group.name):
            found.append(q)
    return np.array(found)


class Bullet:
    """The snake and a scene in PyBullet, which knows nothing of spheres, FCL or this package's kinematics."""

    def __init__(self, scene, folder):
        self.client = pybullet.connect(pybullet.DIRECT)
        file = folder / "snake.urdf"
        file.write_text(SNAKE)
        self.robot = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=self.client)
        self.joints = list(range(pybullet.getNumJoints(self.robot, physicsClientId=self.client)))
        self.things = [self._thing(item) for item in scene.objects.values()]

    def _thing(self, item):
        (shape, inner), = item.shapes
        where = item.pose @ inner
        if isinstance(shape, Box):
            made = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.5 * s for s in shape.size],
                                                 physicsClientId=self.client)
        else:
            made = pybullet.createCollisionShape(pybullet.GEOM_CYLINDER, radius=shape.radius, height=shape.length,
                                                 physicsClientId=self.client)
        turn = pybullet.getQuaternionFromEuler(rpy(where[:3, :3]))
        return pybullet.createMultiBody(0.0, made, -1, where[:3, 3].tolist(), turn, physicsClientId=self.client)

    def deepest(self, q):
        """The deepest contact [m] at the posture ``q``; below 0: how far it is from one, 0.05 at most."""
        for joint, value in zip(self.joints, q, strict=True):
            pybullet.resetJointState(self.robot, joint, value, physicsClientId=self.client)
        found = [point for thing in self.things
                 for point in pybullet.getClosestPoints(self.robot, thing, 0.05, physicsClientId=self.client)]
        for a, b in itertools.combinations(self.joints, 2):
            if b - a > 1:
                found += pybullet.getClosestPoints(self.robot, self.robot, 0.05, a, b, physicsClientId=self.client)
        return max((-point[8] for point in found), default=-0.05)

    def close(self):
        pybullet.disconnect(self.client)


def rpy(rotation):
    """Roll, pitch, yaw of a rotation matrix (3, 3)."""
    return (np.arctan2(rotation[2, 1], rotation[2, 2]), np.arcsin(np.clip(-rotation[2, 0], -1.0, 1.0)),
            np.arctan2(rotation[1, 0], rotation[0, 0]))


def states_on(points, step):
    pieces = [a + (b - a) * np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(b - a) / step))[:, None]
              for a, b in itertools.pairwise(points)]
    return np.concatenate(pieces)


def test_300_paths_are_free_by_pybullet(snake, exact, tmp_path):
    group = snake.groups["arm"]
    worst, detours = [], 0
    for seed in range(33):
        scene = clutter(snake, seed)
        rng = np.random.default_rng((seed, 1))
        bullet = Bullet(scene, tmp_path)
        try:
            ends = free_postures(exact, scene, group, rng, 10)
            for k, (start, goal) in enumerate(itertools.pairwise(ends)):
                try:
                    path = plan_path(scene, "arm", start, [goal], patient(exact, k))
                except NoPath:
                    continue  # a random goal may be shut in
                points = path.points
                assert np.array_equal(points[0], start) and np.allclose(points[-1], goal, atol=1e-6)
                assert (points >= snake.bounds[group.indices, 0] - 1e-6).all()
                assert (points <= snake.bounds[group.indices, 1] + 1e-6).all()
                detours += len(points) > 2
                worst.append(max(bullet.deepest(q) for q in states_on(points, 0.0371)))
        finally:
            bullet.close()
    assert len(worst) >= 270 and detours > 50
    # Bullet's cylinders and contacts are good to a fraction of a millimetre.
    assert max(worst) < 1e-3


def apart(exact, scene, group):
    """Two free postures with something between them."""
    rng = np.random.default_rng(1)
    while True:
        start, goal = free_postures(exact, scene, group, rng, 2)
        between = start + (goal - start) * np.linspace(0.0, 1.0, 50)[:, None]
        if not all(exact.free(scene, scene.state.with_q(q, group.indices)) for q in between):
            return start, goal


def test_the_same_seed_gives_the_same_path(snake, exact):
    scene, group = clutter(snake, 3), snake.groups["arm"]
    start, goal = apart(exact, scene, group)
    paths = [plan_path(scene, "arm", start, [goal], search(exact, seed)).points for seed in (5, 5, 6)]
    assert np.array_equal(paths[0], paths[1])
    assert paths[0].shape != paths[2].shape or not np.allclose(paths[0], paths[2])


def test_the_nearest_of_the_goals_in_a_straight_line(snake, exact):
    scene, group = clutter(snake, 3), snake.groups["arm"]
    start, goal = free_postures(exact, scene, group, np.random.default_rng(1), 2)
    path = plan_path(scene, "arm", start, [goal, start + 1e-3], search(exact))
    assert np.allclose(path.points[-1], start + 1e-3, atol=1e-6)


def test_shorter_and_still_free(snake, exact):
    scene, group = clutter(snake, 4), snake.groups["arm"]
    checker = SphereChecker(SphereModel.of(snake, None), group, scene)
    rng = np.random.default_rng(2)
    run = TreeSearch(3, time.monotonic() + PATIENCE_S, time.monotonic)
    gained = []
    while len(gained) < 20:
        start, goal = free_postures(exact, scene, group, rng, 2)
        if not checker.valid([start, goal]).all():
            continue
        path = rrt_connect(checker, snake.bounds[group.indices], start, [goal], run)
        short = shorten(path, checker, run)
        assert np.allclose(short.points[[0, -1]], path.points[[0, -1]])
        assert all(checker.edge(a, b) for a, b in itertools.pairwise(short.points))
        assert short.length <= path.length + 1e-6
        gained.append(path.length - short.length)
    assert np.mean(gained) > 0.2


def test_a_path_gets_shorter_while_there_is_time(snake, exact):
    group, rng = snake.groups["arm"], np.random.default_rng(4)
    first, better = [], []
    for seed in range(10):
        scene = clutter(snake, seed, 8)
        start, goal = free_postures(exact, scene, group, rng, 2)
        paths = [plan_path(scene, "arm", start, [goal], search(exact, improve=improve)) for improve in (False, True)]
        first.append(paths[0].length)
        better.append(paths[1].length)
        assert np.array_equal(paths[1].points[0], start) and np.array_equal(paths[1].points[-1], paths[0].points[-1])
        assert exact.first_blocked(scene, states_on(paths[1].points, 0.011), "arm") is None
        again = plan_path(scene, "arm", start, [goal], search(exact, improve=True))
        assert np.array_equal(again.points, paths[1].points)
    assert all(after <= before + 1e-6 for before, after in zip(first, better, strict=True))
    assert np.mean(better) < 0.985 * np.mean(first)


def test_a_path_stays_as_it_was_found_without_time_to_improve_it_or_where_that_touches(snake, exact):
    scene, group = clutter(snake, 3), snake.groups["arm"]
    start, goal = apart(exact, scene, group)
    found = plan_path(scene, "arm", start, [goal], search(exact))
    ticks = itertools.count()
    late = SearchOptions(exact, 1, PATIENCE_S, lambda: PATIENCE_S * 0.6 * (next(ticks) > 0), improve=True)
    assert np.array_equal(plan_path(scene, "arm", start, [goal], late).points, found.points)
    watched = Watched(exact)
    plan_path(scene, "arm", start, [goal], search(watched))
    refusing = RefusingLater(exact, len(watched.seen))
    assert np.array_equal(plan_path(scene, "arm", start, [goal], search(refusing, improve=True)).points, found.points)


def test_a_search_gives_up_after_its_samples(snake):
    scene, inside, outside = shut_in(snake)
    checker = SphereChecker(SphereModel.of(snake, None), snake.groups["arm"], scene)
    run = TreeSearch(1, time.monotonic() + PATIENCE_S, time.monotonic, samples=3000)
    with pytest.raises(NoPath, match="3000 samples") as caught:
        rrt_connect(checker, snake.bounds, outside, [inside], run)
    assert caught.value.spent and not caught.value.late


# -- where spheres and exact geometry disagree ----------------------------------------------------------------------

def slot(model, gap):
    """Two plates beside the straight snake's last link, ``gap`` [m] from it on either side."""
    half = 0.03 + gap
    plate = ((Box((0.4, 0.02, 0.4)), np.eye(4)),)
    plates = [WorldObject("plate%d" % side, pose((1.45, side * (half + 0.01), 0.0)), plate) for side in (-1, 1)]
    return Scene(model).with_objects(plates)


def test_a_start_that_only_spheres_call_a_collision_is_left_by_exact_geometry(snake, exact):
    scene, group = slot(snake, 0.006), snake.groups["arm"]
    inside, outside = np.zeros(4), np.array([1.5, 0.2, 0.5, -0.3])
    checker = SphereChecker(SphereModel.of(snake, None), group, scene)
    assert not checker.valid(inside)[0] and exact.free(scene, scene.state.with_q(inside, group.indices))
    for start, goal in ((inside, outside), (outside, inside)):
        path = plan_path(scene, "arm", start, [goal], search(exact))
        assert np.array_equal(path.points[0], start) and np.allclose(path.points[-1], goal, atol=1e-6)
        assert all(exact.free(scene, scene.state.with_q(q, group.indices)) for q in states_on(path.points, 0.011))


class Refusing:
    """An exact checker that refuses what it is told to, for so many questions about states between the ends."""

    def __init__(self, exact, ends, times):
        self.model, self.meshes = exact.model, exact.meshes
        self._exact, self._ends, self._left = exact, ends, times

    def free(self, scene, state, group):
        if any(np.allclose(state.q, end) for end in self._ends):
            return True
        self._left -= 1
        return self._left < 0 and self._exact.free(scene, state, group)

    def first_blocked(self, scene, postures, group):
        self._left -= 1
        return 0 if self._left >= 0 else self._exact.first_blocked(scene, postures, group)

    def contacts(self, *arguments, **more):
        return self._exact.contacts(*arguments, **more)


def test_a_path_that_exact_geometry_refuses_is_not_returned(snake, exact):
    scene, group = clutter(snake, 3), snake.groups["arm"]
    start, goal = apart(exact, scene, group)
    twice = Refusing(exact, (start, goal), 2)
    assert np.allclose(plan_path(scene, "arm", start, [goal], search(twice)).points[-1], goal, atol=1e-6)
    with pytest.raises(NoPath):
        plan_path(scene, "arm", start, [goal], patient(Refusing(exact, (start, goal), 10**9), 1))


class RefusingLater:
    """An exact checker that refuses all that it is asked after so many postures."""

    def __init__(self, exact, patience):
        self.model, self.meshes, self._exact, self._patience = exact.model, exact.meshes, exact, patience

    def free(self, scene, state, group):
        return self._exact.free(scene, state, group)

    def first_blocked(self, scene, postures, group):
        self._patience -= len(postures)
        return 0 if self._patience < 0 else self._exact.first_blocked(scene, postures, group)


class Watched:
    """An exact checker that keeps the postures that it is asked about."""

    def __init__(self, exact):
        self.model, self.meshes, self.seen = exact.model, exact.meshes, []
        self._exact = exact

    def free(self, scene, state, group):
        return self._exact.free(scene, state, group)

    def first_blocked(self, scene, postures, group):
        self.seen.extend(postures)
        return self._exact.first_blocked(scene, postures, group)


def test_exact_geometry_sees_every_corner_every_eighth_state_and_all_that_spheres_doubt(snake, exact):
    scene, group = slot(snake, 0.006), snake.groups["arm"]
    watched = Watched(exact)
    path = plan_path(scene, "arm", np.zeros(4), [np.array([1.5, 0.2, 0.5, -0.3])], search(watched))
    seen, doubted = np.array(watched.seen), 0
    assert all((np.abs(seen - corner).max(axis=1) < 1e-6).any() for corner in path.points)
    checker = SphereChecker(sphere_model_of(watched), group, scene)
    for a, b in itertools.pairwise(path.points):
        count = int(np.ceil(np.linalg.norm(b - a) / checker.resolution))
        states = a + (b - a) * ((np.arange(count) + 0.5) / count)[:, None]
        asked = np.array([(np.abs(seen - q).max(axis=1) < 1e-9).any() for q in states])
        free = checker.valid(states)
        assert (asked | free).all() and asked.sum() >= count // 8
        doubted += (~free).sum()
    assert doubted


# -- two arms ---------------------------------------------------------------------------------------------------------

PAIR = """<robot name="pair"><link name="base"/>%s</robot>""" % "".join("""
<link name="%(n)s_l0"><collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.05 0.05"/></geometry>
</collision></link>
<link name="%(n)s_l1"><collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.05 0.05"/></geometry>
</collision></link>
<joint name="%(n)s_j0" type="revolute"><origin xyz="0 %(y)s 0"/><parent link="base"/><child link="%(n)s_l0"/>
<axis xyz="0 0 1"/><limit lower="-2.8" upper="2.8" effort="1" velocity="1"/></joint>
<joint name="%(n)s_j1" type="revolute"><origin xyz="0.5 0 0"/><parent link="%(n)s_l0"/><child link="%(n)s_l1"/>
<axis xyz="0 0 1"/><limit lower="-2.8" upper="2.8" effort="1" velocity="1"/></joint>""" % {"n": n, "y": y}
                                                                  for n, y in (("a", 0.4), ("b", -0.4)))
PAIR_SRDF = """<robot name="pair"><group name="both"><joint name="a_j0"/><joint name="a_j1"/><joint name="b_j0"/>
<joint name="b_j1"/></group><disable_collisions link1="a_l0" link2="a_l1" reason="Adjacent"/>
<disable_collisions link1="b_l0" link2="b_l1" reason="Adjacent"/></robot>"""


@pytest.fixture(scope="module")
def pair():
    model = PlanningModel.from_xml(PAIR, PAIR_SRDF)
    return model, ExactChecker(model, None)


def test_two_arms_get_past_each_other_each_planned_for_alone(pair):
    model, exact = pair
    scene, group = Scene(model), model.groups["both"]
    checker = SphereChecker(SphereModel.of(model, None), group, scene)
    assert [indices.tolist() for indices, _ in checker.parts] == [[0, 1], [2, 3]]
    # Alone, an arm does not meet the other.
    crossed = np.array([-0.8, 0.0, 0.8, 0.0])
    assert not checker.valid(crossed)[0] and all(alone.valid(crossed[part])[0] for part, alone in checker.parts)
    rng = np.random.default_rng(5)
    found = waited = 0
    for seed in range(150):
        start, goal = free_postures(exact, scene, group, rng, 2)
        if not checker.valid([start, goal]).all():
            continue
        run = TreeSearch(seed, time.monotonic() + PATIENCE_S, time.monotonic)
        path = parts.two_parts(checker, model.bounds[group.indices], start, goal[None], run, 0.5)
        if "shorten" not in path.times:
            continue  # of both arms together
        found += 1
        assert np.allclose(path.points[[0, -1]], [start, goal], atol=1e-6)
        states = states_on(path.points, 0.011)
        assert exact.first_blocked(scene, states, "both") is None
        # Nobody waited where both could move at once.
        moves = np.abs(np.diff(path.points, axis=0)) > 1e-6
        waited += not (moves[:, :2].any(axis=1) & moves[:, 2:].any(axis=1)).all()
    assert found >= 20 and waited >= 2


def test_both_arms_together_and_further_pairs_of_paths_take_turns(pair, monkeypatch):
    model, _ = pair
    group = model.groups["both"]
    checker = SphereChecker(SphereModel.of(model, None), group, Scene(model))
    start, goal, bounds = np.array([0.3, 0.0, -0.3, 0.0]), np.array([-0.3, 2.0, 0.3, 2.0]), model.bounds[group.indices]
    tried = []

    def planned(useless, together):
        def but(passing):
            def failing(*arguments):
                tried.append(passing.__name__)
                points, *more = passing(*arguments)
                return None if len(tried) <= useless else points, *more
            return failing

        tried.clear()
        with monkeypatch.context() as patched:
            for passing in (parts._one_by_one, parts._in_turns):
                patched.setattr(parts, passing.__name__, but(passing))
            patched.setattr(parts, "growing", together)
            return parts.two_parts(checker, bounds, start, goal[None], run, 0.5)

    def endless(searched, within, *arguments):
        return itertools.repeat(None) if within is bounds else growing(searched, within, *arguments)

    run = TreeSearch(3, time.monotonic() + PATIENCE_S, time.monotonic)
    path = planned(20, endless)
    assert len(tried) >= 21 and set(tried[3:]) == {"_in_turns"}
    assert np.allclose(path.points[[0, -1]], [start, goal], atol=1e-6)
    path = planned(math.inf, growing)
    assert 3 <= len(tried) < 100 and np.allclose(path.points[[0, -1]], [start, goal], atol=1e-6)
    # The same seed gives the same path.
    assert np.array_equal(planned(math.inf, growing).points, path.points)


def test_a_posture_aside_that_cannot_be_reached_costs_one_turn_only(pair, monkeypatch):
    model, _ = pair
    group = model.groups["both"]
    # The first arm cannot leave the angle between two posts, nor enter it.
    scene = Scene(model)
    for angle in (1.5, 2.3):
        place = pose((0.3 * math.cos(angle), 0.4 + 0.3 * math.sin(angle), 0.0))
        scene = scene.with_object(WorldObject("post at %g" % angle, place, ((Cylinder(0.02, 0.5), np.eye(4)),)))
    checker = SphereChecker(SphereModel.of(model, None), group, scene)
    enclosed = np.array([1.9, 0.0])
    _, alone = checker.parts[0]
    assert alone.valid(enclosed)[0]
    start, goal, bounds = np.array([0.3, 0.0, -0.3, 0.0]), np.array([-0.3, 2.0, 0.3, 2.0]), model.bounds[group.indices]
    asked = []
    monkeypatch.setattr(parts, "_free_posture_of", lambda *arguments: asked.append(arguments) or enclosed)
    monkeypatch.setattr(parts, "_PAIRS", 0)
    run = TreeSearch(3, time.monotonic() + PATIENCE_S, time.monotonic)
    path = parts.two_parts(checker, bounds, start, goal[None], run, 0.5)
    assert asked and np.allclose(path.points[[0, -1]], [start, goal], atol=1e-6)


def test_one_arm_makes_room_for_the_other_and_comes_back(pair):
    """The arms change sides of each other: on their own ways they cannot pass."""
    model, exact = pair
    scene, group = Scene(model), model.groups["both"]
    checker = SphereChecker(SphereModel.of(model, None), group, scene)
    start, goal, bounds = np.array([0.3, 0.0, -0.3, 0.0]), np.array([-0.3, 2.0, 0.3, 2.0]), model.bounds[group.indices]
    found = 0
    for seed in range(20):
        run = TreeSearch(seed, time.monotonic() + PATIENCE_S, time.monotonic)
        points, samples = parts._in_turns(checker, bounds, start, goal, run, 0.5, seed % 2)
        if points is None:
            continue
        found += 1
        assert samples <= 3 * parts._IN_A_TURN and np.allclose(points[[0, -1]], [start, goal], atol=1e-6)
        assert exact.first_blocked(scene, states_on(points, 0.011), "both") is None
        moves = np.abs(np.diff(points, axis=0)) > 1e-5
        assert not (moves[:, :2].any(axis=1) & moves[:, 2:].any(axis=1)).any()
    assert found >= 5


def test_two_ways_at_once_begin_and_end_together_and_pieces_of_no_length_do_no_harm():
    straight, kinked = np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([[0.0], [2.0], [3.0], [3.0]])
    points = _synchronized([(np.array([0, 2]), None), (np.array([1]), None)], [straight, kinked])
    assert np.allclose(points[[0, -1]], [[0.0, 0.0, 0.0], [1.0, 3.0, 1.0]])
    assert np.allclose(points[:, 0], points[:, 1] / 3.0) and np.allclose(points[:, 0], points[:, 2])
    still = _synchronized([(np.array([0]), None), (np.array([1]), None)], [np.zeros((2, 1)), np.array([[0.0], [1.0]])])
    assert np.allclose(still, [[0.0, 0.0], [0.0, 1.0]])


def test_an_arm_alone_has_no_parts(snake, exact):
    assert SphereChecker(SphereModel.of(snake, None), snake.groups["arm"], Scene(snake)).parts == []


# -- no path --------------------------------------------------------------------------------------------------------

def test_a_collision_at_an_end_is_named(snake, exact):
    scene = Scene(snake).with_object(WorldObject("post", pose((0.6, 0.0, 0.0)), ((Cylinder(0.05, 1.0), np.eye(4)),)))
    free, hit = np.array([1.5, 0.0, 0.0, 0.0]), np.zeros(4)
    for start, goal, what in ((hit, free, "start"), (free, hit, "goal")):
        with pytest.raises(NoPath, match="%s is in collision: link 'l1' and object 'post'" % what):
            plan_path(scene, "arm", start, [goal], search(exact))


@pytest.mark.parametrize(("start", "goals", "text"), [
    ([0.0] * 3, [[0.0] * 4], "need 4 values"), ([0.0] * 4, np.empty((0, 4)), "need 4 values"),
    ([0.0] * 4, [[float("nan")] * 4], "not finite")])
def test_what_are_no_postures_is_refused(snake, exact, start, goals, text):
    with pytest.raises(NoPath, match=text):
        plan_path(Scene(snake), "arm", start, goals, search(exact))


def shut_in(model, gap=0.025):
    """The straight arm lies in a tunnel, ``gap`` [m] from its walls: no joint can turn far enough to get out."""
    off = 0.04 + gap
    walls = [WorldObject("wall%d%d" % (k, side), pose(offset), ((Box((1.6, 0.02, 0.2) if k else (1.6, 0.2, 0.02)),
                                                                np.eye(4)),))
             for k in (0, 1) for side in (-1, 1)
             for offset in [(1.0, off * side, 0.0) if k else (1.0, 0.0, off * side)]]
    return Scene(model).with_objects(walls), np.zeros(4), np.array([1.5, 0.2, 0.5, -0.3])


def test_goals_that_no_way_leads_out_of_are_no_path(snake, exact):
    scene, inside, outside = shut_in(snake, gap=0.006)
    assert not SphereChecker(SphereModel.of(snake, None), snake.groups["arm"], scene).valid(inside)[0]
    for goals in ([inside], [inside, inside + 1e-6]):
        with pytest.raises(NoPath, match="time was over"):
            plan_path(scene, "arm", outside, goals, patient(exact, 1))


def test_time_that_is_over_and_a_stop_are_told_apart(snake, exact):
    scene, start, goal = shut_in(snake)
    assert exact.free(scene, scene.state.with_q(goal, snake.groups["arm"].indices), "arm")
    with pytest.raises(NoPath, match="time was over") as caught:
        plan_path(scene, "arm", start, [goal], search(exact, allowed_time=0.4))
    assert caught.value.late and not caught.value.stopped
    asked = itertools.count()
    with pytest.raises(NoPath, match="stopped while") as caught:
        plan_path(scene, "arm", start, [goal], search(exact, stop=lambda: next(asked) > 10))
    assert caught.value.stopped and not caught.value.late


def test_warming_up_compiles_all_that_planning_needs(tmp_path):
    """Set-up's warm-up fills the cache; planning afterwards compiles nothing."""
    code = """
import runpy, sys
runpy.run_module("motion_planning", run_name="__main__")
from motion_planning.exact import kernels as exact
from motion_planning.planners import kernels as planning
from motion_planning.spheres import kernel
for function in (planning.grow, planning.shortcut, kernel.free_states, kernel.free_edges, exact.unproven,
                 exact.fill_poses, planning.traced, planning.between_checked, kernel.free_way, exact.balls_of):
    print(function.__name__, len(function.signatures))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["grow", "1", "shortcut", "1", "free_states", "1", "free_edges", "1", "unproven", "1",
                                   "fill_poses", "1", "traced", "1", "between_checked", "1", "free_way", "1",
                                   "balls_of", "1"]
