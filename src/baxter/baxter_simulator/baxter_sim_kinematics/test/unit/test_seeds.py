# SPDX-License-Identifier: BSD-3-Clause
"""Which seeds the service tries, in which order, and its remarks about unusable ones."""
import numpy as np
import pytest
from baxter_core_msgs.srv import SolvePositionIKRequest

from arm_kinematics import Chain, InvalidPosture, NoSolution, PostureMap, Reason
from arm_kinematics.errors import Attempt, InvalidSeed
from baxter_sim_kinematics.seeds import SeedMode, SeedPolicy, SeedRequest, seed_mode

GIVEN, CURRENT, IN_MAP, NEUTRAL = 0.1, 0.2, 0.3, 0.4
SEED = (["turn"], [GIVEN])


@pytest.fixture
def chain():
    return Chain("base", "tip", [("turn", "revolute", "tip", np.eye(4), (0, 0, 1), -1.0, 1.0)])


class Robot:
    """A robot with a posture, or with the reason why it is not known."""

    def __init__(self):
        self.problem = None

    def __call__(self):
        if self.problem:
            raise InvalidPosture(self.problem, None)
        return np.array([CURRENT])


@pytest.fixture
def robot():
    return Robot()


@pytest.fixture
def policy(chain, robot):
    return SeedPolicy(chain, PostureMap(chain, [[IN_MAP]]), np.array([NEUTRAL]), robot)


def failure(reason):
    return NoSolution(np.eye(4), reason, "no", Attempt(np.zeros(1), np.eye(4), 1.0, 0.0))


def tried(policy, mode, given=(), reason=Reason.NOT_CONVERGED, remarks=None):
    """The seeds that are tried while each search fails for ``reason``."""
    seeds = []

    def solve(seed):
        seeds.append(float(seed[0]))
        raise failure(reason)

    with pytest.raises(NoSolution):
        policy.answer(SeedRequest(mode, list(given), 1), 0, np.eye(4), solve, [] if remarks is None else remarks)
    return seeds


def test_modes_have_the_numbers_of_the_message():
    assert {mode.name: mode.value for mode in SeedMode} == {
        name: getattr(SolvePositionIKRequest, "SEED_" + name) for name in ("AUTO", "USER", "CURRENT", "NS_MAP")}


def test_number_that_is_no_mode_is_refused():
    with pytest.raises(InvalidSeed, match="seed_mode 9 is unknown; use 0 AUTO"):
        seed_mode(9)


@pytest.mark.parametrize("mode, given, seeds", [
    (SeedMode.AUTO, [SEED], [GIVEN, CURRENT, IN_MAP]), (SeedMode.AUTO, [], [CURRENT, IN_MAP]),
    (SeedMode.AUTO, [([], [])], [CURRENT, IN_MAP]), (SeedMode.USER, [SEED], [GIVEN]),
    (SeedMode.CURRENT, [SEED], [CURRENT]), (SeedMode.NS_MAP, [SEED], [IN_MAP])])
def test_order_of_the_seeds(policy, mode, given, seeds):
    assert tried(policy, mode, given) == seeds


def test_first_seed_that_leads_there_is_the_type_of_the_answer(policy):
    request = SeedRequest(SeedMode.AUTO, [SEED], 1)
    assert policy.answer(request, 0, np.eye(4), lambda seed: "there", []) == (SeedMode.USER, "there")


@pytest.mark.parametrize("reason", [reason for reason in Reason if reason is not Reason.NOT_CONVERGED])
def test_diagnosis_of_the_pose_ends_the_tries(policy, reason):
    assert tried(policy, SeedMode.AUTO, [SEED], reason) == [GIVEN]


def test_user_mode_without_a_seed_says_how_many_there_are(policy):
    request = SeedRequest(SeedMode.USER, [SEED], 2)
    with pytest.raises(InvalidSeed, match=r"this one has none \(1 seed for 2 poses\)"):
        policy.answer(request, 1, np.eye(4), lambda seed: None, [])


def test_seed_that_fits_no_joint_is_an_error_or_left_out(policy):
    wrong = (["other"], [0.0])
    with pytest.raises(InvalidSeed, match="its seed cannot be used: no value for turn"):
        policy.answer(SeedRequest(SeedMode.USER, [wrong], 1), 0, np.eye(4), lambda seed: None, [])
    remarks = []
    assert tried(policy, SeedMode.AUTO, [wrong], remarks=remarks) == [CURRENT, IN_MAP]
    assert len(remarks) == 1 and remarks[0].startswith("the seed of pose 1 is left out: no value for turn")


def test_neutral_stands_in_for_an_unknown_posture_and_that_is_said_once(policy, robot):
    remarks = []
    robot.problem = "nothing heard"
    for _ in range(3):
        assert tried(policy, SeedMode.CURRENT, remarks=remarks) == [NEUTRAL]
    assert remarks == ["nothing heard; the neutral posture replaces the current one"]
    robot.problem = None
    assert tried(policy, SeedMode.CURRENT, remarks=remarks) == [CURRENT]
    robot.problem = "nothing heard"
    tried(policy, SeedMode.CURRENT, remarks=remarks)
    assert len(remarks) == 2
