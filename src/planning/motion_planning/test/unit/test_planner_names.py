# SPDX-License-Identifier: BSD-3-Clause
"""Every planner name that people configure plans; what stands for another is said."""
import itertools
import time

import numpy as np
import pytest

from motion_planning.exact import ExactChecker
from motion_planning.model import PlanningModel
from motion_planning.planners import NoPath, SearchOptions, TreeSearch, ompl_wheel, plan_path, rrt_connect, warm_up
from motion_planning.planners.names import NAMES, config_name, kind_of, planner_of
from motion_planning.planners.planning import checker_of
from motion_planning.scene import Scene, WorldObject
from urdf_model import Box
from urdf_model.transforms import rigid

# As long as a slow machine may need: what is tested is the answer. Anytime planners take all they get.
PATIENCE_S, BRIEF_S = 60.0, 3.0

# The names of MoveIt's documentation.
MOVEIT = """AnytimePathShortening BFMT BiEST BiTRRT BKPIECE EST FMT KPIECE LazyPRM LazyPRMstar LazyRRT LBKPIECE LBTRRT
PDST PRM PRMstar ProjEST RRT RRTConnect RRTstar SBL SPARS SPARStwo STRIDE TRRT AITstar ABITstar BITstar""".split()

URDF = """<robot name="pair"><link name="base"/>
<link name="arm"><collision><origin xyz="0.25 0 0"/><geometry><box size="0.5 0.05 0.05"/></geometry></collision></link>
<link name="hand"><collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.05 0.05"/></geometry></collision></link>
<joint name="a" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="b" type="revolute"><origin xyz="0.5 0 0"/><parent link="arm"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint></robot>"""
SRDF = """<robot name="pair"><group name="both"><joint name="a"/><joint name="b"/></group>
<disable_collisions link1="arm" link2="hand" reason="Adjacent"/></robot>"""
START, GOAL = np.array([-1.0, 0.0]), np.array([1.0, 0.0])


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """The time that a plan may take is none for the compiler."""
    warm_up()


@pytest.fixture(scope="module")
def exact():
    return ExactChecker(PlanningModel.from_xml(URDF, SRDF), None)


@pytest.fixture(scope="module")
def scene(exact):
    """A post that the straight arm cannot pass, the folded one can."""
    return Scene(exact.model).with_object(
        WorldObject("post", rigid(np.eye(3), (0.8, 0.0, 0.0)), ((Box((0.1, 0.1, 0.3)), np.eye(4)),)))


def search(exact, planner, allowed=PATIENCE_S, **more):
    return SearchOptions(exact, 1, allowed, time.monotonic, planner=planner, **more)


@pytest.mark.parametrize("name", sorted({*MOVEIT, *NAMES}))
def test_every_name_plans(name, exact, scene):
    planner, remarks = planner_of(name, {})
    anytime = isinstance(planner, ompl_wheel.OmplPlanner) and planner.name in ompl_wheel.ANYTIME
    points = plan_path(scene, "both", START, GOAL, search(exact, planner, BRIEF_S if anytime else PATIENCE_S)).points
    assert np.allclose(points[[0, -1]], [START, GOAL]) and len(points) > 2
    for a, b in itertools.pairwise(points):
        assert exact.first_blocked(scene, a + (b - a) * np.linspace(0.0, 1.0, 50)[:, None], "both") is None
    own = name == "RRTConnect" or name in ompl_wheel.CLASSES
    assert len(remarks) == (not own) and all("'%s' is not built in" % name in remark for remark in remarks)


def test_moveits_names_are_all_known():
    assert set(MOVEIT) <= set(NAMES)


def test_names_come_as_configurations_and_types():
    planners = {"Mine": {"type": "geometric::RRTstar"}, "Old": {}, "FMTkConfigDefault": {"type": "geometric::FMT"}}
    assert kind_of("arm[Mine]", planners) == "RRTstar" == kind_of("Mine", planners)
    assert kind_of("FMTkConfigDefault", planners) == "FMT" == kind_of("FMTkConfigDefault", {})
    assert kind_of("", planners) == "" and kind_of("Old", planners) == "Old"
    assert config_name("left_arm[RRT]") == "RRT" and config_name("RRT") == "RRT"


def test_names_that_nobody_knows_are_told():
    planner, remarks = planner_of("Warp", {})
    assert planner is rrt_connect and remarks == ["there is no planner 'Warp'; RRTConnect plans"]


def test_without_the_wheel_another_plans_and_says_how_to_get_it(monkeypatch):
    def missing():
        raise ImportError

    monkeypatch.setattr(ompl_wheel, "_library", missing)
    for name, standing in (("RRTstar", "RRTstar"), ("PRMstar", "RRTstar")):
        planner, remarks = planner_of(name, {})
        assert planner is rrt_connect and len(remarks) == 1
        assert "'%s' is one of the ompl wheel" % standing in remarks[0] and "pip install ompl==" in remarks[0]


def test_settings_reach_the_planner():
    planner, remarks = planner_of("RRTstar", {"type": "geometric::RRTstar", "range": "0.2", "goal_bias": "0.3",
                                              "delay_collision_checking": "1"})
    assert not remarks
    made = planner._made(ompl_wheel._Space(None, np.zeros((2, 1))))[0]
    assert made.getRange() == pytest.approx(0.2) and made.getGoalBias() == pytest.approx(0.3)
    _, remarks = planner_of("RRT", {"colour": "red", "goal_bias": "much"})
    assert remarks == ["planner RRT has no setting 'colour'",
                       "planner RRT cannot take 'much' for its setting 'goal_bias'"]


def test_the_range_of_our_own_counts(exact, scene):
    planner, _ = planner_of("RRTConnect", {"range": "0.05"})
    checker = _Everything()
    run = TreeSearch(1, time.monotonic() + PATIENCE_S, time.monotonic)
    assert planner.keywords == {"reach": 0.05} and planner_of("RRTConnect", {"range": "0.0"})[0] is rrt_connect
    assert planner_of("RRTConnect", {"range": "far"})[0] is rrt_connect
    assert len(planner(checker, exact.model.bounds, START, GOAL, run).points) == 2


class _Everything:
    """A checker to which all is free."""

    def valid(self, states):
        return np.ones(len(np.atleast_2d(states)), dtype=bool)

    def edge(self, a, b):
        return True


class _Nothing(_Everything):
    """Postures are free, no edge is."""

    def edge(self, a, b):
        return False


@pytest.mark.parametrize("name", sorted(ompl_wheel.CLASSES))
def test_the_wheels_planners_end_when_they_are_told_to(name, exact):
    planner, _ = planner_of(name, {})
    bounds = exact.model.bounds
    # Time is the number of looks at the clock.
    with pytest.raises(NoPath) as late:
        planner(_Nothing(), bounds, START, GOAL, TreeSearch(1, 300, itertools.count().__next__))
    assert late.value.late or "ended without a path" in str(late.value)
    looks = itertools.count()
    with pytest.raises(NoPath) as stopped:
        planner(_Nothing(), bounds, START, GOAL,
                TreeSearch(1, time.monotonic() + PATIENCE_S, time.monotonic, lambda: next(looks) > 50))
    assert stopped.value.stopped


def test_a_checker_that_raises_ends_the_search(exact):
    class Broken(_Nothing):
        def valid(self, states):
            raise ZeroDivisionError

    planner, _ = planner_of("RRT", {})
    with pytest.raises(ZeroDivisionError):
        planner(Broken(), exact.model.bounds, START, GOAL, TreeSearch(1, time.monotonic() + PATIENCE_S, time.monotonic))


def test_anytime_planners_find_shorter_paths_than_quick_ones(exact, scene):
    checker = checker_of(exact, scene, exact.model.groups["both"])
    lengths = {}
    for name, seconds in (("RRT", PATIENCE_S), ("RRTstar", BRIEF_S)):
        planner, _ = planner_of(name, {})
        lengths[name] = [planner(checker, exact.model.bounds, START, GOAL,
                                 TreeSearch(1, time.monotonic() + seconds, time.monotonic)).length for _ in range(3)]
    assert np.median(lengths["RRTstar"]) < np.median(lengths["RRT"])
