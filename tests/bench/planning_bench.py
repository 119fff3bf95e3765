# SPDX-License-Identifier: BSD-3-Clause
"""Planning: our planner and the ``ompl`` wheel's RRTConnect on exact geometry, on the same problems.

Both arms of Baxter at a bookshelf, 360 of 1,800 problems in five rounds, or all of them (``--all``); one arm of Baxter,
and PROBOT, at a table and a shelf. Times are CPU times of one thread, so that other work on the machine counts little.
Every path is checked again by exact geometry, at states that the planner did not check.
"""
import os
import time

import numpy as np
import planning_problems as problems

from motion_planning.planners import NoPath, SearchOptions, plan_path, prepare

# Time allowed for each problem [s], and for the peer.
LIMIT_S, PEER_LIMIT_S = 1.0, 10.0
# One in so many of the 1,800 problems is in each of five rounds; with --all, one in five.
EVERY, EVERY_OF_ALL = 25, 5
# Number of problems in each round: of each kind of ours; of those for the peer.
ONE_ARM, PEER = 50, 4
# The planner's resolution [rad]; the check adds a fraction of it so that it visits other states.
RESOLUTION, SHIFT = 1.0 / 64.0, 0.31
CLOCK = time.thread_time


def measure(report, quick, number):
    share = 10 if quick else 1
    baxter, probot = problems.baxter(), problems.probot()
    # The first plan makes the spheres and compiles the code, so it does not count.
    prepare(baxter.exact)
    prepare(probot.exact)
    solve(problems.table(baxter, problems.BAXTER_PLACE, -1 - number), patience_s=100.0)
    solve(problems.table(probot, problems.PROBOT_PLACE, -1 - number), patience_s=100.0)
    try:
        bookshelf = problems.bookshelf(baxter)
    except OSError as error:
        print("the bookshelf problems could not be fetched (%s); they are left out" % error)
    else:
        solve(bookshelf[0], patience_s=100.0)
        # Each round has other problems, of each level.
        some = bookshelf[number % 5 :: share * (EVERY_OF_ALL if os.environ.get("BENCH_ALL") else EVERY)]
        found = [solve(problem) for problem in some]
        note(report, "both arms, bookshelf", some, found, {"median": 3.0, "p95": 25.0, "shorten": 0.5, "length": 8.5})
        improved(report, "both arms, bookshelf", some, found)
        beside_peer(report, "both arms, bookshelf", bookshelf[number % 5 :: len(bookshelf) // (1 if quick else PEER)],
                    ratio_most=0.01)
    for name, robot, place in (("Baxter, one arm", baxter, problems.BAXTER_PLACE),
                               ("PROBOT", probot, problems.PROBOT_PLACE)):
        for kind in (problems.table, problems.shelf):
            some = [kind(robot, place, number * ONE_ARM + k) for k in range(ONE_ARM // share)]
            title = "%s, %s" % (name, kind.__name__)
            note(report, title, some, [solve(problem) for problem in some], {"median": 1.0})
            beside_peer(report, title, some[: 1 if quick else PEER])


def solve(problem, patience_s=LIMIT_S, improve=False):
    """Return (Path or None, seconds in all)."""
    begin = CLOCK()
    try:
        path = plan_path(problem.scene, problem.group, problem.start, [problem.goal],
                         SearchOptions(problem.robot.exact, 1, patience_s, CLOCK, improve=improve))
    except NoPath as error:
        print("%s: %s" % (problem.name, error))
        path = None
    return path, CLOCK() - begin


def note(report, title, some, found, goals):
    """Note the figures of problems of one kind. goals: {figure: most}."""
    solved = [path for path, _ in found if path is not None]
    report.add("%s: solved within %g s" % (title, LIMIT_S), 100.0 * len(solved) / len(some), "%", samples=len(some),
               pooled=True, least=100.0)
    hit = sum(not walked(problem, path.points)
              for problem, (path, _) in zip(some, found, strict=True) if path is not None)
    report.add("%s: paths with a collision by exact geometry" % title, 100.0 * hit / max(1, len(solved)), "%",
               samples=max(1, len(solved)), pooled=True, most=0.0)
    if not solved:
        return
    planning = np.array([1e3 * (path.times["way out"] + path.times["search"]) for path in solved])

    def add(what, value, unit, key=None):
        report.add("%s: %s" % (title, what), value, unit, samples=len(solved),
                   **({"most": goals[key]} if key in goals else {}))

    add("planning, median", np.median(planning), "ms", "median")
    add("planning, 95 %", np.percentile(planning, 95), "ms", "p95")
    add("planning, longest", planning.max(), "ms")
    add("shortcuts, median", 1e3 * np.median([path.times["shorten"] for path in solved]), "ms", "shorten")
    add("length afterwards, mean", np.mean([path.length for path in solved]), "rad", "length")
    add("all, exact check and tables too, median", 1e3 * np.median([seconds for _, seconds in found]), "ms")
    report.sample("%s: planning" % title, "ms", ours=planning)


def improved(report, title, some, found):
    """Note how much shorter the paths ``found`` get in the time that a request leaves."""
    pairs = [(problem, before, after) for problem, (before, _) in zip(some, found, strict=True)
             for after, _ in [solve(problem, improve=True)] if before is not None and after is not None]
    if not pairs:
        return
    report.add("%s: length of improved paths beside that of the first" % title,
               np.mean([after.length for _, _, after in pairs]), "rad",
               ("first", np.mean([before.length for _, before, _ in pairs])), samples=len(pairs), ratio_most=0.9)
    report.add("%s: time for that, median" % title, 1e3 * np.median([after.times["improve"] for *_, after in pairs]),
               "ms", samples=len(pairs))
    report.add("%s: improved paths with a collision by exact geometry" % title, 100.0 * np.mean(
        [not walked(problem, after.points) for problem, _, after in pairs]), "%", samples=len(pairs), pooled=True,
               most=0.0)


def walked(problem, points):
    """Return whether exact geometry finds the whole path free."""
    indices = problem.robot.model.groups[problem.group].indices
    for a, b in zip(points[:-1], points[1:], strict=True):
        count = int(np.ceil(np.linalg.norm(b - a) / RESOLUTION))
        for k in range(count):
            state = problem.scene.state.with_q(a + (b - a) * (k + SHIFT) / count, indices)
            if not problem.robot.exact.free(problem.scene, state, problem.group):
                return False
    return True


# -- the peer -------------------------------------------------------------------------------------------------------

def beside_peer(report, title, some, **goal):
    """Note our planning time beside the peer's on the same few problems, in turns; a problem that the peer does not
    solve counts with its time limit. goal: one of the report's, where there is one."""
    try:
        from ompl import base, geometric, util
    except ImportError:
        return
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    ours, theirs, solved = [], [], 0
    for problem in some:
        path, seconds = solve(problem)
        ours.append(seconds if path is None else path.times["way out"] + path.times["search"])
        peer, found = solve_by_ompl(base, geometric, problem)
        theirs.append(peer)
        solved += found
    report.add("%s: planning beside OMPL's RRTConnect, which solved %d of %d in %g s" % (
        title, solved, len(some), PEER_LIMIT_S), 1e3 * np.mean(ours), "ms", ("RRTConnect, FCL", 1e3 * np.mean(theirs)),
        samples=len(some), **goal)


def solve_by_ompl(base, geometric, problem):
    """Return (seconds, whether it was solved) of RRTConnect with the range and the resolution of our planner."""
    model, exact = problem.robot.model, problem.robot.exact
    group = model.groups[problem.group]
    space, bounds = base.RealVectorStateSpace(len(group)), base.RealVectorBounds(len(group))
    for k, index in enumerate(group.indices):
        bounds.setLow(k, float(min(model.bounds[index, 0], problem.start[k], problem.goal[k])))
        bounds.setHigh(k, float(max(model.bounds[index, 1], problem.start[k], problem.goal[k])))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)

    def is_free(state):
        q = [state[k] for k in range(len(group))]
        return exact.free(problem.scene, problem.scene.state.with_q(q, group.indices), problem.group)

    setup.setStateValidityChecker(is_free)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(RESOLUTION / space.getMaximumExtent())
    start, goal = space.allocState(), space.allocState()
    for k in range(len(group)):
        start[k], goal[k] = float(problem.start[k]), float(problem.goal[k])
    setup.setStartAndGoalStates(start, goal)
    planner = geometric.RRTConnect(information)
    planner.setRange(0.5)
    setup.setPlanner(planner)
    begin = CLOCK()
    setup.solve(PEER_LIMIT_S)
    return CLOCK() - begin, setup.haveExactSolutionPath()
