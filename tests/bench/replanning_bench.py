# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles that enter the way of joints that move: how soon another way is there, how often it needs no stop.

A box appears around the arm's tip as it will be some time later. CPU times of one thread, so that other work on the
machine counts little: from the changed scene to the trajectory that takes the other's place. A way exists if the same
planner finds one from rest within seconds. Every motion that takes over is walked by exact geometry, from the moment at
which it begins.
"""
import time
from dataclasses import replace

import numpy as np
import planning_problems as problems

from motion_planning.constraints import ConstraintSet, JointTarget, sampler
from motion_planning.pipeline import PlanningFailure, PlanQuery, Tools, plan
from motion_planning.planners import first_touching, plan_path, prepare
from motion_planning.replanning import Running, redirected
from motion_planning.scene import WorldObject
from urdf_model import Box
from urdf_model.transforms import pose_matrix

# Obstacles for each kind of robot and place in a round; how long after its appearance the tip would be in it [s].
OBSTACLES, LATER_S = 12, (0.6, 1.4)
# Sides of the boxes in units of the place's size [m].
SIDES = (0.06, 0.14)
# Joint limits of the configurations, as move_group has them.
LIMITS = "config/joint_limits.yaml"
# Time for a plan from rest [s], which tells whether there is a way at all.
FROM_REST_S = 5.0
# Distance of states that are walked [rad], and of those that are looked at for what is in the way.
WALKED, LOOKED_AT = 0.004, 0.05


def measure(report, quick, number):
    count = 2 if quick else OBSTACLES
    for name, robot, place in (("Baxter, one arm", problems.baxter(LIMITS), problems.BAXTER_PLACE),
                               ("PROBOT", problems.probot(LIMITS), problems.PROBOT_PLACE)):
        prepare(robot.exact)
        for kind in (problems.table, problems.shelf):
            rng = np.random.default_rng(number)
            found, seed = [], number * 100
            while len(found) < count and seed < number * 100 + 10 * count:
                one = obstacle(kind(robot, place, seed), place, rng)
                found += [one] if one is not None else []
                seed += 1
            note(report, "%s, %s" % (name, kind.__name__), found)


def note(report, title, some):
    answers = [answer(*one) for one in some]
    exists = [one for one in answers if one["exists"]]
    ways = [one for one in exists if "way" in one]
    report.add("%s: other ways found while moving, of those there are" % title, 100.0 * len(ways) / max(1, len(exists)),
               "%", samples=len(exists), pooled=True)
    report.add("%s: time to the answer, median" % title, 1e3 * np.median([one["seconds"] for one in answers]), "ms",
               samples=len(answers), most=50.0)
    report.add("%s: time to the answer, longest" % title, 1e3 * max(one["seconds"] for one in answers), "ms",
               samples=len(answers))
    report.add("%s: ways without a stop" % title, 100.0 * np.mean([one["way"].overlap > 0.0 for one in ways] or [0.0]),
               "%", samples=len(ways), pooled=True)
    report.add("%s: motions that touch something" % title, 100.0 * np.mean([one["touches"] for one in ways] or [0.0]),
               "%", samples=len(ways), pooled=True, most=0.0)


def obstacle(problem, place, rng):
    """(problem, its goals, Timed, now [s], the scene with the obstacle), None if there is no plan or no room."""
    group = problem.robot.model.groups[problem.group]
    goals = [ConstraintSet("goal", [JointTarget(joint, float(value), 1e-3, 1e-3)
                                    for joint, value in zip(group.joints, problem.goal, strict=True)])]
    scene = problem.scene.with_state(problem.scene.state.with_q(problem.start, group.indices))
    try:
        timed = plan(PlanQuery(scene, problem.group, goals), tools(problem)).timed
    except PlanningFailure:
        return None
    later = rng.uniform(*LATER_S)
    if timed.duration < later + 0.6:
        return None
    now = rng.uniform(0.2, timed.duration - later - 0.2)
    at = scene.state.with_q(timed.sampled([now + later])[0][0], group.indices)
    middle = problem.robot.model.frame_of(at.q, place.tip)[:3, 3]
    box = WorldObject("intruder", pose_matrix(middle), ((Box(tuple(rng.uniform(*SIDES, 3) * place.size)), np.eye(4)),))
    scene = scene.with_state(scene.state.with_q(timed.sampled([now])[0][0], group.indices))
    changed = scene.with_object(box)
    near = timed.sampled(np.linspace(max(0.0, now - 0.1), now + 0.15, 8))[0]
    end = changed.state.with_q(timed.positions[-1], group.indices)
    if problem.robot.exact.first_blocked(changed, near, problem.group) is not None or \
            not problem.robot.exact.free(changed, end, problem.group):
        return None
    return problem, goals, timed, now, changed


def tools(problem):
    return Tools(problem.robot.exact, plan_path, sampler, time.thread_time)


def answer(problem, goals, timed, now, scene):
    group, exact = problem.robot.model.groups[problem.group], problem.robot.exact
    query = PlanQuery(scene, problem.group, goals)
    begin = time.thread_time()
    times = timed.spaced(LOOKED_AT)
    times = times[times >= now]
    first = first_touching(exact, scene, group, timed.sampled(times)[0])
    found = {}
    try:
        found["way"] = redirected(query, tools(problem), Running(timed, now, float(times[first])))
    except PlanningFailure as failure:
        print("%s: %s" % (problem.name, failure))
    found["seconds"] = time.thread_time() - begin
    try:
        plan(replace(query, allowed_time=FROM_REST_S), tools(problem))
        found["exists"] = True
    except PlanningFailure:
        found["exists"] = False
    if "way" in found:
        way = found["way"]
        before = np.arange(now, way.begin, 0.01)
        states = np.concatenate([timed.sampled(before)[0], way.timed.sampled(way.timed.spaced(WALKED))[0]])
        found["touches"] = exact.first_blocked(scene, states, problem.group) is not None
    return found
