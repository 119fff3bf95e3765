# SPDX-License-Identifier: BSD-3-Clause
"""Grasps and places: which is chosen, what the stages are, and what is said where none works."""
import itertools
import math

import numpy as np
import pytest

from motion_planning.exact import ExactChecker
from motion_planning.manipulation import (
    Candidate,
    ManipulationFailure,
    ManipulationTools,
    PickTask,
    PlaceTask,
    Translation,
    hand_links,
    places_on,
    plan_manipulation,
)
from motion_planning.manipulation.places import lowest
from motion_planning.pipeline import Code, Plan, PlanningFailure
from motion_planning.scene import Scene, SceneError, WorldObject
from motion_planning.shapes import Cone, TriangleMesh
from motion_planning.timing import time_path
from urdf_model import Box, Cylinder, Plane, Sphere
from urdf_model.transforms import axis_rotation, rigid

NEUTRAL = {"left_s0": 0.0, "left_s1": -0.55, "left_e0": 0.0, "left_e1": 0.75, "left_w0": 0.0, "left_w1": 1.26,
           "left_w2": 0.0}
DOWN = np.diag([1.0, -1.0, -1.0])
TABLE_Z, BLOCK = -0.15, (0.04, 0.04, 0.1)
SPOT = np.array([0.65, 0.2, TABLE_Z + 0.05])
ARM, LINK = "left_arm", "left_gripper"
FINGER = "l_gripper_l_finger_joint"
UP = np.array([0.0, 0.0, 1.0])
LIFT = Translation(UP, desired=0.1, least=0.05)
LOWER = Translation(-UP, desired=0.1, least=0.05)


@pytest.fixture(scope="module")
def exact(baxter, meshes):
    return ExactChecker(baxter, meshes)


@pytest.fixture(scope="module")
def hand(baxter):
    return hand_links(baxter, baxter.groups["left_hand"].end_effector)


@pytest.fixture()
def scene(baxter):
    state = baxter.state({**NEUTRAL, FINGER: 0.0})
    scene = Scene(baxter, state)
    # The robot's own links, which an SRDF has its say on, are not the matter here.
    own = dict.fromkeys(itertools.combinations(baxter.links, 2), True)
    return scene.with_allowed(scene.allowed.with_entries(own)).with_objects([
        thing("table", (0.7, 0.2, TABLE_Z - 0.05), (0.6, 0.8, 0.1)), thing("block", SPOT, BLOCK)])


def thing(name, position, size):
    return WorldObject(name, rigid(np.eye(3), np.array(position, dtype=float)), ((Box(tuple(size)), np.eye(4)),))


def from_above(name="top", z=0.03, **options):
    options = {"approach": LOWER, "retreat": LIFT, "before": {FINGER: 0.0208}, "after": {FINGER: 0.0}, **options}
    return Candidate(name, rigid(DOWN, SPOT + (0.0, 0.0, z)), **options)


def tools(exact, plan=None, **options):
    ticks = itertools.count()
    return ManipulationTools(exact, plan or straight_plan, lambda: next(ticks) * 1e-4, **options)


def straight_plan(scene, q, seconds):
    group = scene.model.groups[ARM]
    path = np.array([scene.state.q[group.indices], q])
    return Plan(scene.state, path, time_path(path, np.ones(7), np.ones(7)), 0.0)


def pick(scene, exact, hand, candidates, seconds=60.0, plan=None, **options):
    task = PickTask(scene, ARM, LINK, hand, "block", **{"support": "table", **options})
    return plan_manipulation(task, candidates, seconds, tools(exact, plan))


def tip(stage, timed_index):
    model, group = stage.scene.model, stage.scene.model.groups[ARM]
    q = stage.timed.positions[timed_index]
    return model.frame_of(stage.scene.state.with_q(q, group.indices).q, LINK, stage.scene.state.base)


def test_a_hand_has_its_fingers(baxter, hand):
    assert hand == {"left_gripper_base", "left_gripper", "l_gripper_l_finger", "l_gripper_l_finger_tip",
                    "l_gripper_r_finger", "l_gripper_r_finger_tip"}


def test_stages_of_a_pick(scene, exact, hand):
    found = pick(scene, exact, hand, [from_above()])
    assert [stage.description for stage in found.stages] == ["plan", "pre_grasp", "approach", "grasp", "retreat"]
    plan, opened, approach, closed, retreat = found.stages
    np.testing.assert_allclose(plan.timed.positions[-1], approach.timed.positions[0], atol=1e-6)
    np.testing.assert_allclose(approach.timed.positions[-1], retreat.timed.positions[0], atol=1e-6)
    np.testing.assert_allclose(tip(approach, 0)[:3, 3], SPOT + (0, 0, 0.13), atol=2e-3)
    np.testing.assert_allclose(tip(approach, -1)[:3, 3], SPOT + (0, 0, 0.03), atol=2e-3)
    np.testing.assert_allclose(tip(retreat, -1)[:3, 3], SPOT + (0, 0, 0.13), atol=2e-3)
    for stage in (approach, retreat):
        tilt = np.array([tip(stage, i)[:3, 2] @ (0, 0, -1) for i in range(0, len(stage.timed.times), 5)])
        assert tilt.min() > math.cos(0.02)
    assert opened.posture == {FINGER: 0.0208} and closed.posture == {FINGER: 0.0}
    assert "block" in retreat.scene.state.attached and "block" in approach.scene.objects
    assert retreat.scene.state.attached["block"].touch_links >= hand


def test_the_best_that_works_is_taken_and_the_others_are_told(scene, exact, hand):
    far = from_above("far", quality=0.9)
    far.pose[:3, 3] += (2.0, 0.0, 0.0)
    deep = from_above("deep", z=-0.056, quality=0.8)  # the fingers would be in the table
    found = pick(scene, exact, hand, [from_above("poor", quality=0.1), far, from_above("good", quality=0.5), deep])
    assert found.candidate.name == "good"
    assert [(fall.candidate, fall.stage) for fall in found.falls] == [("far", "reach"), ("deep", "grasp pose")]
    assert "table" in found.falls[1].reason


def test_nothing_works_and_every_fall_is_named(scene, exact, hand):
    scene = scene.with_object(thing("lamp", SPOT + (0.0, 0.0, 0.62), (0.5, 0.5, 0.02)))
    far = from_above("far")
    far.pose[:3, 3] += (2.0, 0.0, 0.0)
    with pytest.raises(ManipulationFailure, match="'far' fails at 'reach'.*'top' fails at 'approach'.*lamp") as caught:
        pick(scene, exact, hand, [far, from_above(approach=LOWER._replace(desired=0.3, least=0.3))])
    assert caught.value.code == Code.PLANNING_FAILED and len(caught.value.falls) == 2
    with pytest.raises(ManipulationFailure, match="none of 1 candidates") as caught:
        pick(scene, exact, hand, [far])
    assert caught.value.code == Code.NO_IK_SOLUTION
    with pytest.raises(ManipulationFailure, match="list of candidates is empty"):
        pick(scene, exact, hand, [])


@pytest.mark.parametrize("option", ["approach", "retreat"])
def test_less_than_the_least_is_desired(scene, exact, hand, option):
    short = from_above(**{option: (LOWER if option == "approach" else LIFT)._replace(desired=0.02)})
    with pytest.raises(ManipulationFailure, match=f"at '{option}': 0.02 m are desired and at least 0.05 m allowed"):
        pick(scene, exact, hand, [short])


def test_a_shorter_way_will_do_down_to_the_least(scene, exact, hand):
    low = scene.with_object(thing("shelf", SPOT + (0.0, 0.0, 0.62), (0.5, 0.5, 0.02)))
    way = LOWER._replace(desired=0.3, least=0.02)
    found = pick(low, exact, hand, [from_above(approach=way)])
    height = tip(found.stages[2], 0)[2, 3] - SPOT[2] - 0.03
    assert 0.02 <= height < 0.28
    with pytest.raises(ManipulationFailure, match=r"of at least 0\.290 m.*shelf"):
        pick(low, exact, hand, [from_above(approach=way._replace(least=0.29))])


def test_without_its_name_the_support_stops_the_retreat(scene, exact, hand):
    sunk = scene.moved("block", rigid(np.eye(3), SPOT - (0.0, 0.0, 0.001)))
    with pytest.raises(ManipulationFailure, match="'retreat': at its begin attached object 'block' and object 'table'"):
        pick(sunk, exact, hand, [from_above()], support="")
    assert pick(sunk, exact, hand, [from_above()]).candidate.name == "top"


def test_what_the_object_would_touch_counts_too(scene, exact, hand):
    beside = scene.with_object(thing("sill", SPOT + (0.0, 0.09, -0.03), (0.1, 0.03, 0.03)))
    sideways = from_above(retreat=Translation(np.array([0.0, 1.0, 0.0]), desired=0.1, least=0.1))
    with pytest.raises(ManipulationFailure, match="'retreat'.*attached object 'block' and object 'sill'"):
        pick(beside, exact, hand, [sideways])
    assert pick(scene, exact, hand, [sideways])


def test_the_hand_may_touch_what_a_grasp_names_and_the_support_where_it_is_said(scene, exact, hand):
    cup = scene.with_object(thing("cup", SPOT + (0.0, 0.06, 0.0), (0.03, 0.06, 0.1)))
    with pytest.raises(ManipulationFailure, match="cup"):
        pick(cup, exact, hand, [from_above(z=-0.01)])
    assert pick(cup, exact, hand, [from_above(z=-0.01, touch=frozenset(["cup"]))])
    deep = from_above(z=-0.055)
    with pytest.raises(ManipulationFailure, match="table"):
        pick(scene, exact, hand, [deep])
    assert pick(scene, exact, hand, [deep], hand_may_touch_support=True)


def test_directions_in_the_hand_turn_with_it(scene, exact, hand):
    along = Translation(UP, in_hand=True, desired=0.1, least=0.1)
    found = pick(scene, exact, hand, [from_above(approach=along)])
    np.testing.assert_allclose(tip(found.stages[2], 0)[:3, 3], SPOT + (0, 0, 0.13), atol=2e-3)


def test_closing_in_ends_before_the_object(scene, exact, hand):
    candidate = from_above(z=0.2, before={FINGER: 0.0}, retreat=LIFT)
    found = pick(scene, exact, hand, [candidate], minimize_distance=True)
    end = tip(found.stages[2], -1)[2, 3] - SPOT[2]
    assert 0.05 - 0.01 < end < 0.08, "fingers over the block's top, 0.05 m above its middle"


def test_a_path_that_cannot_be_planned_is_told_and_the_next_is_tried(scene, exact, hand):
    asked = []

    def plan(scene, q, seconds):
        asked.append(seconds)
        if len(asked) == 1:
            raise PlanningFailure(Code.TIMED_OUT, "no way round")
        return straight_plan(scene, q, seconds)

    found = pick(scene, exact, hand, [from_above("a"), from_above("b")], seconds=8.0, plan=plan)
    assert found.candidate.name == "b" and str(found.falls[0]) == "'a' fails at 'plan': no way round"
    assert asked[0] < 4.0 < asked[1]
    with pytest.raises(ManipulationFailure) as caught:
        asked.clear()
        pick(scene, exact, hand, [from_above("a")], plan=plan)
    assert caught.value.code == Code.TIMED_OUT


def test_time_and_stop_end_it(scene, exact, hand):
    task = PickTask(scene, ARM, LINK, hand, "block", support="table")
    with pytest.raises(ManipulationFailure, match="0 of 2 candidates were tried") as caught:
        plan_manipulation(task, [from_above("a"), from_above("b")], 0.0, tools(exact))
    assert caught.value.code == Code.TIMED_OUT
    with pytest.raises(ManipulationFailure) as caught:
        plan_manipulation(task, [from_above()], 5.0, tools(exact, stop=lambda: True))
    assert caught.value.code == Code.PREEMPTED


def held(scene, exact, hand):
    """The scene after a pick."""
    retreat = pick(scene, exact, hand, [from_above()]).stages[-1]
    state = retreat.scene.state.with_q(retreat.timed.positions[-1], scene.model.groups[ARM].indices)
    return scene.without_object("block").with_state(state)


def test_what_was_picked_up_is_put_down(scene, exact, hand):
    scene = held(scene, exact, hand)
    task = PlaceTask(scene, ARM, LINK, hand, "block", support="table")
    there = rigid(np.eye(3), SPOT + (0.05, -0.15, 0.001))
    candidate = Candidate("there", task.hand_pose(there), LOWER, LIFT, after={FINGER: 0.0208})
    found = plan_manipulation(task, [candidate], 60.0, tools(exact))
    assert [stage.description for stage in found.stages] == ["plan", "approach", "grasp", "retreat"]
    assert "block" in found.stages[1].scene.state.attached
    np.testing.assert_allclose(found.stages[-1].scene.objects["block"].pose, there, atol=1e-3)
    np.testing.assert_allclose(tip(found.stages[1], -1)[:3, 3], there[:3, 3] + (0, 0, 0.03), atol=2e-3)


def test_no_place_where_something_stands(scene, exact, hand):
    there = SPOT + (0.05, -0.15, 0.001)
    scene = held(scene, exact, hand).with_object(thing("vase", there, (0.05, 0.05, 0.2)))
    task = PlaceTask(scene, ARM, LINK, hand, "block", support="table")
    with pytest.raises(ManipulationFailure, match="'there' fails at 'grasp pose'.*vase") as caught:
        plan_manipulation(task, [Candidate("there", task.hand_pose(rigid(np.eye(3), there)), LOWER, LIFT)], 60.0,
                          tools(exact))
    assert caught.value.code == Code.GOAL_IN_COLLISION


def test_names_that_are_not_there(scene, hand):
    with pytest.raises(SceneError, match="no object 'brick' to pick up; it has 'table', 'block'"):
        PickTask(scene, ARM, LINK, hand, "brick")
    with pytest.raises(SceneError, match="does not hold an object 'block'; it has none"):
        PlaceTask(scene, ARM, LINK, hand, "block")


def test_places_on_a_table_are_on_it_and_the_nearest_comes_first(scene):
    poses = places_on(scene, "table", scene.objects["block"])
    spots = np.array([pose[:3, 3] for pose in poses])
    assert len(poses) > 20
    assert (np.abs(spots[:, :2] - (0.7, 0.2)) < (0.3, 0.4)).all()
    np.testing.assert_allclose(spots[:, 2], TABLE_Z + 0.051, atol=1e-9)
    distances = np.linalg.norm(spots[:, :2] - SPOT[:2], axis=1)
    assert distances[0] < 0.08 and (np.diff(distances) >= -1e-9).all()
    with pytest.raises(SceneError, match="'desk' is not in the scene"):
        places_on(scene, "desk", scene.objects["block"])


def test_a_plane_cannot_be_put_down(scene):
    with pytest.raises(SceneError, match="plane"):
        places_on(scene, "table", WorldObject("wall", np.eye(4), ((Plane(), np.eye(4)),)))


@pytest.mark.parametrize("shape, upright, tilted", [
    (Box((0.2, 0.4, 0.6)), 0.3, 0.2), (Sphere(0.1), 0.1, 0.1),
    (Cylinder(0.1, 0.6), 0.3, 0.1), (Cone(0.1, 0.6), 0.3, 0.1),
    (TriangleMesh(np.array([(0.0, 0.0, -0.3), (0.0, 0.2, 0.0), (0.1, -0.2, 0.0)]), np.array([(0, 1, 2)])), 0.3, 0.2)])
def test_lowest_points(shape, upright, tilted):
    turns = {0.0: upright, math.pi / 2.0: tilted}
    for angle, depth in turns.items():
        pose = rigid(axis_rotation((1.0, 0.0, 0.0), angle), np.array([1.0, 2.0, 3.0]))
        assert lowest(WorldObject("it", pose, ((shape, np.eye(4)),))) == pytest.approx(3.0 - depth)
