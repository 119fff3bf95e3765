# SPDX-License-Identifier: BSD-3-Clause
"""A few of the poses of `bench verdict`: the cause is known by construction, and the diagnosis must name it."""
import importlib
import sys
from pathlib import Path

import numpy as np
import PyKDL
import pytest

from arm_kinematics import NoSolution, Reason
from arm_kinematics.errors import Attempt
from arm_kinematics.target import METRES_PER_RADIAN

BENCH = Path(__file__).resolve().parents[1] / "bench"
RIGHT = 0.95
# Takes 20 s to build on an arm of seven joints: few poses need two of them.
SLOW = "two joints' limits"


@pytest.fixture(scope="module")
def modules():
    sys.path.insert(0, str(BENCH))
    yield {name: importlib.import_module(name) for name in ("arms", "bad_poses", "ik_oracle")}
    sys.path.remove(str(BENCH))


@pytest.fixture(scope="module")
def arms(modules):
    return {arm.name: arm for arm in modules["arms"].arms()}


@pytest.fixture(scope="module", params=["left arm", "PROBOT"])
def judged(request, modules, arms):
    """(builder, [(case, verdict)]) of one arm."""
    arm = arms[request.param]
    checker = modules["arms"].checker_of(arm)
    builder = modules["bad_poses"].Builder(arm.robot, arm.chain, checker, np.random.default_rng(11), starts=150)
    cases = [case for kind in modules["bad_poses"].KINDS if kind != SLOW for case in builder.build(kind, 2)]
    yield builder, [(case, builder.ask(case)) for case in cases]
    checker.close()


def test_verdict_names_the_cause(judged):
    builder, answers = judged
    wrong = ["%s: %s" % (case.kind, failure) for case, failure in answers if not builder.right(case, failure)]
    assert len(wrong) <= (1.0 - RIGHT) * len(answers), "\n".join(wrong)


def test_wrong_verdict_is_not_taken_for_right(judged):
    """The judge itself must reject a wrong cause, joint, pair or distance."""
    builder, answers = judged
    for case, failure in answers:
        assert not builder.right(case, None)
        others = [{"reason": reason} for reason in Reason if reason is not failure.reason]
        if failure.pair:
            others.append({"pair": ("post", "nothing")})
        if failure.joints:
            others += [{"excess": (0.0,)}, {"excess": (failure.excess[0] + 1.0,)}, {"joints": (), "excess": ()}]
        if failure.reason is Reason.OUT_OF_REACH:
            others.append({"residual_m": failure.residual_m + 0.5})
        for change in others:
            assert not builder.right(case, changed(failure, **change)), (case.kind, change)


def changed(failure, **changes):
    attempt = Attempt(failure.best, failure.nearest, changes.pop("residual_m", failure.residual_m),
                      failure.residual_rad)
    values = {name: getattr(failure, name) for name in ("target", "reason", "detail", "joints", "excess", "pair")}
    return NoSolution(attempt=attempt, **{**values, **changes})


@pytest.mark.parametrize("name", ["left arm", "right arm", "PROBOT"])
def test_oracle_places_the_tip_where_kdl_does(modules, arms, name):
    arm = arms[name]
    oracle = modules["ik_oracle"].Oracle(arm.robot, arm.chain.base, arm.chain.tip, METRES_PER_RADIAN)
    model = modules["arms"].kdl_chain(arm)
    position, jacobian = PyKDL.ChainFkSolverPos_recursive(model), PyKDL.ChainJntToJacSolver(model)
    values, frame, peer = PyKDL.JntArray(len(arm.chain)), PyKDL.Frame(), PyKDL.Jacobian(len(arm.chain))
    for q in np.random.default_rng(12).uniform(oracle.lower, oracle.upper, (5, len(arm.chain))):
        modules["arms"].fill(values, q.tolist())
        position.JntToCart(values, frame)
        jacobian.JntToJac(values, peer)
        _, _, ours = oracle.place(q[None])
        np.testing.assert_allclose(oracle.fk(q), [[frame[i, k] for k in range(4)] for i in range(3)] + [[0, 0, 0, 1]],
                                   atol=1e-9)
        np.testing.assert_allclose(ours[0], [[peer[i, k] for k in range(len(q))] for i in range(6)], atol=1e-9)


def test_oracle_finds_solutions_and_keeps_the_limits(modules, arms):
    arm = arms["left arm"]
    oracle = modules["ik_oracle"].Oracle(arm.robot, arm.chain.base, arm.chain.tip, METRES_PER_RADIAN, 100)
    rng = np.random.default_rng(13)
    for q in rng.uniform(oracle.lower, oracle.upper, (5, 7)):
        found, least = oracle.solutions(oracle.fk(q), rng)
        assert len(found) >= 5 and least < modules["ik_oracle"].ARRIVED
        assert (found >= oracle.lower).all() and (found <= oracle.upper).all()
        for other in found[:3]:
            np.testing.assert_allclose(oracle.fk(other), oracle.fk(q), atol=1e-4)
