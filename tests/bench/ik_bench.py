# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of random reachable poses, to 1e-5 m and rad from mid-range: ours compared with TRAC-IK and KDL.

Every pose is the forward kinematics of a posture drawn evenly between the limits. A pose counts as solved when our
forward kinematics confirms it to 2e-5 m and 2e-5 rad inside the limits. TRAC-IK gets its usual limit of 5 ms per pose,
and so does KDL with restarts. A round has 2,000 poses of each arm, so five rounds have 10,000; the shares solved are of
all rounds together. TRAC-IK returns the first solution found, and so does ours in the first row. The IK service returns
the nearest of several; it has its own row.
"""
import tempfile
import time
from pathlib import Path

import numpy as np
import PyKDL
from arms import arms, checker_of, fill, kdl_chain
from ik_oracle import Oracle

from arm_kinematics import Budget, NoSolution, solve, solve_batch, warm_up
from arm_kinematics.budget import SERVICE_BUDGET as SERVICE
from arm_kinematics.target import METRES_PER_RADIAN
from urdf_model.transforms import rotation_angle

POSES = 2000
KDL_POSES = 500  # of those: KDL takes milliseconds for each pose that it does not solve
TOLERANCE = 1e-5
CONFIRMED = 2e-5
# KDL weighs a radian as a hundredth of a metre, so this is 1e-5 of either.
KDL_TOLERANCE = 0.01 * TOLERANCE
LIMIT_SLACK = 1e-6  # rad; pytracik keeps limits in single precision
LIMIT_S = 0.005
TRAC = "TRAC-IK"
# Joint motion between two commands at 50 Hz [rad].
SERVO_STEP = 0.02
# Number of starts of the independent search that tells whether a collision-free posture exists.
RESTARTS = 200


def confirmed(chain, q, target):
    if q is None or (q < chain.lower - LIMIT_SLACK).any() or (q > chain.upper + LIMIT_SLACK).any():
        return False
    tip = chain.fk(q)
    return (np.linalg.norm(tip[:3, 3] - target[:3, 3]) <= CONFIRMED
            and rotation_angle(tip[:3, :3].T @ target[:3, :3]) <= CONFIRMED)


def timed(chain, targets, seeds, answer):
    """Return (share solved [%], times [ms]) of ``answer(target, seed)`` -> q or None."""
    times, solved = [], 0
    for target, seed in zip(targets, seeds, strict=True):
        start = time.perf_counter()
        q = answer(target, seed)
        times.append(1e3 * (time.perf_counter() - start))
        solved += confirmed(chain, q, target)
    return 100.0 * solved / len(targets), np.array(times)


def ours(chain, candidates, checker=None):
    budget = Budget(candidates, tolerance_m=TOLERANCE, tolerance_rad=TOLERANCE)

    def answer(target, seed):
        try:
            return solve(chain, target, seed, budget=budget, checker=checker).q
        except NoSolution:
            return None

    return answer


def trac_ik(arm):
    """Return a function like :func:`ours`, or None where pytracik is not installed."""
    try:
        from trac_ik import TracIK
    except ImportError:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(arm.urdf)
        solver = TracIK(base_link_name=arm.chain.base, tip_link_name=arm.chain.tip, urdf_path=str(path),
                        timeout=LIMIT_S, epsilon=TOLERANCE)
    return lambda target, seed: solver.ik(target[:3, 3], target[:3, :3], seed_jnt_values=seed)


def kdl(arm, restarts):
    """KDL's Levenberg-Marquardt, which knows no limits; with ``restarts`` from random postures until one is inside."""
    model, chain = kdl_chain(arm), arm.chain
    solver = PyKDL.ChainIkSolverPos_LMA(model, KDL_TOLERANCE, 500)
    start, found = PyKDL.JntArray(len(chain)), PyKDL.JntArray(len(chain))
    rng = np.random.default_rng(0)

    def answer(target, seed, _alive=model):  # the solver refers to the chain without holding it
        frame = PyKDL.Frame(PyKDL.Rotation(*target[:3, :3].ravel().tolist()), PyKDL.Vector(*target[:3, 3].tolist()))
        deadline = time.perf_counter() + LIMIT_S
        while True:
            fill(start, seed.tolist())
            status = solver.CartToJnt(start, frame, found)
            q = np.array([found[i] for i in range(len(chain))])
            middle = chain.mid_range
            q -= 2.0 * np.pi * np.round((q - middle) / (2.0 * np.pi))
            if status >= 0 and confirmed(chain, q, target):
                return q
            if not restarts or time.perf_counter() > deadline:
                return None
            seed = rng.uniform(chain.lower, chain.upper)

    return answer


def measure(report, quick, number):
    count = POSES // 10 if quick else POSES
    checked = arms()
    for k, arm in enumerate(checked):
        warm_up(arm.chain)
        compare(report, arm, count, np.random.default_rng((number, k)))
    batch(report, checked[0], count * 5, np.random.default_rng((number, 7)))
    for k, arm in enumerate(checked):
        clear(report, arm, count // 8, np.random.default_rng((number, 8, k)))


def compare(report, arm, count, rng):
    chain = arm.chain
    postures = rng.uniform(chain.lower, chain.upper, (count, len(chain)))
    targets = [chain.fk(q) for q in postures]
    middle = [chain.mid_range] * count
    share, times = timed(chain, targets, middle, ours(chain, 1))
    two_share, two_times = timed(chain, targets, middle, ours(chain, 2))
    service_share, service_times = timed(chain, targets, middle, ours(chain, SERVICE.candidates))
    peers = {TRAC: (trac_ik(arm), count), "KDL LMA": (kdl(arm, False), min(count, KDL_POSES)),
             "KDL, restarts": (kdl(arm, True), min(count, KDL_POSES))}
    every = {"samples": count, "pooled": True, "least": 99.99}
    report.add("%s: solved" % arm.name, share, "%", **every)
    report.add("%s: p99" % arm.name, np.percentile(times, 99), "ms", samples=count, most=1.0)
    report.add("%s: nearer of two, solved" % arm.name, two_share, "%", **every)
    report.add("%s: nearer of two, p99" % arm.name, np.percentile(two_times, 99), "ms", samples=count, most=1.0)
    report.add("%s: the service's nearest of %d, solved" % (arm.name, SERVICE.candidates), service_share, "%",
               **every)
    report.add("%s: the service's nearest of %d, p99" % (arm.name, SERVICE.candidates),
               np.percentile(service_times, 99), "ms", samples=count)
    distributions = {"ours": times}
    for name, (answer, poses) in peers.items():
        if answer is None:
            continue
        other_share, other_times = timed(chain, targets[:poses], middle[:poses], answer)
        distributions[name] = other_times
        report.add("%s: unsolved, beside %s" % (arm.name, name), 100.0 - share, "%", (name, 100.0 - other_share),
                   samples=count, pooled=True)
        report.add("%s: mean, beside %s" % (arm.name, name), times.mean(), "ms", (name, other_times.mean()),
                   samples=count, **({"ratio_most": 0.1} if name == TRAC else {}))
        if name == TRAC:
            report.add("%s: median" % arm.name, np.median(times), "ms", (name, np.median(other_times)), samples=count)
            report.add("%s: p99, beside %s" % (arm.name, name), np.percentile(times, 99), "ms",
                       (name, np.percentile(other_times, 99)), samples=count)
            report.add("%s: nearer of two, mean" % arm.name, two_times.mean(), "ms", (name, other_times.mean()),
                       samples=count)
            report.add("%s: the service's nearest of %d, mean" % (arm.name, SERVICE.candidates),
                       service_times.mean(), "ms", (name, other_times.mean()), samples=count)
    report.sample("time for a pose, %s" % arm.name, "ms", **distributions)
    servo(report, arm, postures, rng)


def servo(report, arm, postures, rng):
    """Targets that are a small step away from the start posture."""
    chain = arm.chain
    near = np.clip(postures + rng.normal(0.0, SERVO_STEP, postures.shape), chain.lower, chain.upper)
    targets = [chain.fk(q) for q in near]
    share, times = timed(chain, targets, postures, ours(chain, 1))
    report.add("%s: servoing, solved" % arm.name, share, "%", samples=len(targets), pooled=True, least=99.99)
    answer = trac_ik(arm)
    if answer is not None:
        _, other_times = timed(chain, targets, postures, answer)
        report.add("%s: servoing, mean" % arm.name, times.mean(), "ms", (TRAC, other_times.mean()),
                   samples=len(targets))
    some = min(len(targets), KDL_POSES)
    _, other_times = timed(chain, targets[:some], postures[:some], kdl(arm, False))
    report.add("%s: servoing, mean, beside KDL LMA" % arm.name, times.mean(), "ms", ("KDL LMA", other_times.mean()),
               samples=len(targets))


def batch(report, arm, count, rng):
    chain = arm.chain
    targets = np.array([chain.fk(q) for q in rng.uniform(chain.lower, chain.upper, (count, len(chain)))])
    budget = Budget(candidates=1, tolerance_m=TOLERANCE, tolerance_rad=TOLERANCE)
    rates = {}
    for threads in (1, None):
        start = time.perf_counter()
        found = solve_batch(chain, targets, chain.mid_range, budget=budget, threads=threads)
        rates[threads] = count / (time.perf_counter() - start)
        assert found.solved.mean() > 0.999
    report.add("batch on all cores", rates[None], "poses/s", ("one core", rates[1]), samples=count, least=10000)


def clear(report, arm, count, rng):
    """Poses for which at least one of RESTARTS independent starts finds a collision-free posture."""
    chain = arm.chain
    checker = checker_of(arm)
    oracle = Oracle(arm.robot, chain.base, chain.tip, METRES_PER_RADIAN, RESTARTS)
    targets = []
    while len(targets) < count:
        target = oracle.fk(rng.uniform(chain.lower, chain.upper))
        arrived, _ = oracle.solutions(target, rng)
        if any(checker.contact(chain.joint_names, q) is None for q in arrived):
            targets.append(target)
    middle = [chain.mid_range] * count
    share, times = timed(chain, targets, middle, ours(chain, 2, checker))
    _, plain = timed(chain, targets, middle, ours(chain, 2))
    checker.close()
    report.add("%s: clear of itself, solved where one of %d restarts is clear" % (arm.name, RESTARTS), share, "%",
               samples=count, pooled=True, least=99.0)
    report.add("%s: clear of itself, mean" % arm.name, times.mean(), "ms", ("without looking", plain.mean()),
               samples=count, most=5.0)
