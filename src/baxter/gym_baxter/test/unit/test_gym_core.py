# SPDX-License-Identifier: BSD-3-Clause
"""The environments without Gymnasium; `checked_by_gymnasium.py` has what needs it."""
import copy
import gc
import pickle
import subprocess
import sys

import numpy as np
import pytest

from baxter_lab import LabError, Options, Which, pose
from gym_baxter.controls import CONTROLS, action_size
from gym_baxter.core import Choices, Core
from gym_baxter.randomised import Randomised
from gym_baxter.tasks import TABLE_TOP_M, TASKS

PLAIN = Options(with_meshes=False)
EPISODE = """
import hashlib, numpy as np
from baxter_lab import Options
from gym_baxter.core import Choices, Core
core = Core("PickPlace", Choices("osc_pose", options=Options(with_meshes=False)))
found = [core.reset(np.random.default_rng(7))["state"]]
for action in np.random.default_rng(8).uniform(-1.0, 1.0, (5, core.action_size)):
    found.append(core.step(action).observation["state"])
print(hashlib.sha256(np.array(found).tobytes()).hexdigest())
"""


@pytest.fixture(scope="module")
def made():
    """{task: its Core}, made when they are asked for."""
    found = {}

    def of(task):
        if task not in found:
            found[task] = Core(task, Choices("osc_pose", options=PLAIN))
        return found[task]

    yield of
    for core in found.values():
        core.close()


def played(core, seed, count=4):
    found = [core.reset(np.random.default_rng(seed))["state"]]
    for action in np.random.default_rng(seed + 1).uniform(-1.0, 1.0, (count, core.action_size)):
        stepped = core.step(action)
        found.append(np.append(stepped.observation["state"], stepped.reward))
        assert 0.0 <= stepped.reward <= 1.0 and np.isfinite(found[-1]).all()
    return np.concatenate(found)


def test_robot_and_things_are_observed_together_or_apart():
    core = Core("PickPlace", Choices(obs_type="environment_state_agent_pos", options=PLAIN))
    apart = core.reset(np.random.default_rng(1))
    assert list(apart) == ["agent_pos", "environment_state"]
    assert len(apart["environment_state"]) == len(core.task.OBSERVED)
    together = np.concatenate([core.agent_pos(), core.task.observed()])
    np.testing.assert_array_equal(np.concatenate(list(apart.values())), together)
    core.close()


@pytest.mark.parametrize("task", TASKS)
def test_equal_seeds_give_equal_episodes_whatever_was_before(made, task):
    core = made(task)
    first = played(core, 1)
    other = played(core, 2)
    np.testing.assert_array_equal(first, played(core, 1))
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("task", TASKS)
def test_a_saved_state_goes_on_to_the_bit(made, task):
    core = made(task)
    core.reset(np.random.default_rng(3))
    actions = np.random.default_rng(4).uniform(-1.0, 1.0, (4, core.action_size))
    core.step(actions[0])
    state, found = core.save(), []
    for _ in range(2):
        found.append([core.step(action).observation["state"] for action in actions])
        for _ in range(8):  # somewhere else, with other contacts
            core.step(-actions[0])
        core.restore(state)
    np.testing.assert_array_equal(*found)


def test_processes_agree_to_the_bit():
    told = {subprocess.run([sys.executable, "-c", EPISODE], capture_output=True, text=True, check=True).stdout
            for _ in range(2)}
    assert len(told) == 1 and len(told.pop()) > 60


def test_a_deviation_in_space_moves_the_hand_by_it(made):
    core = made("Reach")
    core.reset(np.random.default_rng(0))
    arm = core.lab.robot.left
    before, action = arm.pose, np.zeros(core.action_size)
    action[:6] = (0.4, 0.0, 0.4, 0.0, 0.0, 0.2)  # 2 cm ahead and up, 0.1 rad about z
    core.step(action)
    for _ in range(8):
        core.step(np.zeros(core.action_size))
    np.testing.assert_allclose(arm.pose[:3, 3] - before[:3, 3], (0.02, 0.0, 0.02), atol=4e-3)
    turn = arm.pose[:3, :3] @ before[:3, :3].T
    assert np.arctan2(turn[1, 0], turn[0, 0]) == pytest.approx(0.1, abs=0.02)


def test_success_is_told(made):
    core = made("Reach")
    core.reset(np.random.default_rng(0))
    core.task.goal = core.lab.robot.left.pose[:3, 3].copy()
    stepped = core.step(np.zeros(core.action_size))
    assert stepped.succeeded and stepped.reward > 0.8
    core = made("PickPlace")
    core.reset(np.random.default_rng(0))
    core.task.block.put(core.task.goal)
    assert core.step(np.zeros(core.action_size)).succeeded
    core = made("TwoArmLift")
    core.reset(np.random.default_rng(0))
    assert not core.task.succeeded()
    core.task.pot.put((0.66, 0.0, TABLE_TOP_M + core.task.HALF_M + 0.12))
    assert core.task.succeeded() and core.task.reward() == 1.0
    tilted = pose((0.66, 0.0, TABLE_TOP_M + core.task.HALF_M + 0.12), (1.0, 0.0, 0.0))
    core.task.pot.put(tilted)
    assert core.task.succeeded() and core.task.reward() < 0.5


def test_the_grippers_of_the_physical_robots_profile_move():
    """They take no command before they are calibrated."""
    core = Core("PickPlace", Choices(options=Options(which=Which(profile="robot"), with_meshes=False)))
    core.reset(np.random.default_rng(1))
    for arm in core.lab.robot.arms.values():
        arm.gripper.open()
        arm.gripper.close()
        assert arm.gripper.position < 5.0
    core.close()


def test_an_arm_that_has_collided_stands_and_goes_on_from_where_it_is():
    """The environment ended with an error of the robot, in the middle of an episode."""
    core = Core("Reach", Choices("osc_pose", options=Options(which=Which(profile="robot"), with_meshes=False)))
    core.reset(np.random.default_rng(1))
    core.lab.add_box("wall", (0.1, 0.6, 0.6), tuple(core.lab.robot.left.pose[:3, 3] + (0.2, 0.0, 0.0)))
    arm, action = core.lab.robot.left, np.zeros(core.action_size)
    action[0], actions = 0.4, 0
    while not core.lab.robot.simulated.baxter.halted("left"):
        core.step(action)
        actions += 1
        assert actions < 60
    places = []
    for _ in range(70):  # it stands for 2 s, pushed on
        action[0] = -0.1 if len(places) > 50 else 0.4 if len(places) < 30 else 0.0
        core.step(action)
        places.append(arm.pose[0, 3])
    assert max(places[:50]) - min(places[:50]) < 0.03
    assert max(-np.diff(places)) < 0.02 and places[50] - places[-1] > 0.03
    core.close()


@pytest.mark.parametrize(("task", "choices", "named"), [
    ("Juggle", Choices(), "PickPlace"), ("Reach", Choices(control="torque"), "osc_pose"),
    ("Reach", Choices(control_freq=30), "control_freq is 30"),
    ("Reach", Choices(physics_step_s=0.0), "physics_step_s is 0"), ("Reach", Choices(obs_type="smell"), "pixels"),
    ("Reach", Choices(cameras="head"), "cameras is 'head'"), ("Reach", Choices(cameras=("foot",)), "left_hand"),
    ("Reach", Choices(randomised={"mass": 0.3}), "gym_baxter.Randomised"),
    ("Reach", Choices(size=84.5), "whole number"),
    ("Reach", Choices(randomised=Randomised(mass="much")), "randomised.mass is 'much'"),
    ("Reach", Choices(options={}), "baxter_lab.Options"), ("Reach", Choices(control_freq="20"), "control_freq is '20'"),
    ("Reach", Choices(robosuite_order="no"), "True or False")])
def test_unknown_names_are_refused_with_the_choices(task, choices, named):
    with pytest.raises(ValueError, match=named):
        Core(task, choices)


def test_the_state_of_another_environment_is_refused_and_changes_nothing(made):
    reach, place = made("Reach"), made("PickPlace")
    for core in (reach, place):
        core.reset(np.random.default_rng(0))
    state = reach.save()
    for _ in range(3):
        reach.step(np.full(reach.action_size, 0.5))
    before = reach.observation()["state"], place.observation()["state"]
    for other in (state, None, "state"):
        with pytest.raises(LabError, match=r"its own save\(\)|of its own"):
            place.restore(other)
    np.testing.assert_array_equal(before[0], reach.observation()["state"])
    np.testing.assert_array_equal(before[1], place.observation()["state"])


def test_a_state_cannot_be_copied_nor_leave_its_process(made):
    state = made("Reach").save()
    for leave in (pickle.dumps, copy.deepcopy):
        with pytest.raises(LabError, match="leave its process"):
            leave(state)


def test_states_that_nobody_holds_are_freed(made):
    lab = made("Reach").lab
    lab.save()
    gc.collect()
    lab.save()
    numbers = {lab.save()._number for _ in range(20)}
    assert len(numbers) < 5  # Bullet gives the number of a freed state again
    assert len(lab.forgotten_states) <= 1


@pytest.fixture(scope="module")
def noisy():
    core = Core("Reach", Choices("osc_pose", options=Options(which=Which(profile="robot"), with_meshes=False)))
    yield core
    core.close()


def held(core, seed, count=4):
    """(count, n) angles that an arm at rest has by its sensors, in an episode."""
    core.reset(np.random.default_rng(seed))
    found = []
    for _ in range(count):
        core.step(np.zeros(core.action_size))
        found.append(core.agent_pos()[:7])
    return np.array(found)


def test_the_physical_robots_sensors_have_noise_of_each_episode(noisy):
    """The profile has it; observations were the truth."""
    one, again, other = held(noisy, 1), held(noisy, 1), held(noisy, 2)
    np.testing.assert_array_equal(one, again)
    assert 1e-4 < np.abs(np.diff(one, axis=0)).max() < 0.01  # [rad]
    assert (one != other).any(axis=0).all()
    robot = noisy.lab.robot
    true = robot.simulated.model.read_joints()[0][robot.simulated.limb_index["left"]]
    assert 0.0 < np.abs(robot.left.angles - true).max() < 0.005


def test_a_state_holds_the_noise_as_well(noisy):
    held(noisy, 3)
    state, action = noisy.save(), np.full(noisy.action_size, 0.1)
    one = [noisy.step(action).observation["state"] for _ in range(3)]
    held(noisy, 4)
    noisy.restore(state)
    np.testing.assert_array_equal(one, [noisy.step(action).observation["state"] for _ in range(3)])


def test_an_action_of_another_size_is_refused(made):
    core = made("Reach")
    core.reset(np.random.default_rng(0))
    for action in ([0.0] * 3, [float("nan")] * core.action_size):
        with pytest.raises(ValueError, match=str(core.action_size)):
            core.step(action)
    assert {control: action_size(control) for control in CONTROLS} == {
        "joint_delta": 16, "joint_pos": 16, "osc_pose": 14}


def test_an_open_drawer_is_success(made):
    core = made("Drawer")
    core.reset(np.random.default_rng(0))
    task, before = core.task, core.task.handle()
    assert not task.succeeded() and task.reward() < 0.25
    task.cabinet.model.set_joint_positions(task._joint, np.array([0.16]))
    assert task.succeeded() and task.reward() > 0.75
    assert np.linalg.norm(task.handle() - before) == pytest.approx(0.16, abs=1e-3)


def test_the_peg_fits_as_in_robosuite(made):
    """Figures of robosuite 1.5.2 without noise of the start, for a peg with a radius of 22.5 mm."""
    core = made("TwoArmPegInHole")
    core.reset(np.random.default_rng(0))
    task = core.task
    assert task._fit(*task._frames()) == pytest.approx((0.268690, 0.217048, 0.899488), abs=1e-5)
    assert task.reward() == pytest.approx(0.620904, abs=1e-5)
    for name, frames in (("in the hole", [np.eye(4), np.eye(4)]), ("before it", [np.eye(4), np.eye(4)])):
        frames[1][:3, 3] = (0.1, 0.0, -0.1 if name == "in the hole" else -0.2)
        assert task._is_in(*task._fit(*frames)) == (name == "in the hole")


def test_the_tools_of_the_peg_weigh_and_touch(made):
    model = made("TwoArmPegInHole").lab.robot.simulated.model
    masses = {side: model.merged.links[model.merged.frames[tool].link].inertial.mass
              for side, tool in (("left", "plate"), ("right", "peg"))}
    assert masses["left"] - masses["right"] == pytest.approx(2.112 - 0.4135, abs=1e-3)


def test_things_in_their_bins_are_success(made):
    core = made("TwoArmTransport")
    core.reset(np.random.default_rng(0))
    task = core.task
    for thing, name in ((task.trash, "trash_bin"), (task.hammer, "target_bin")):
        assert not task.succeeded()
        x, y, _ = task.bins[name].position
        thing.put((x, y, TABLE_TOP_M + 0.05))
        for _ in range(10):
            core.step(np.zeros(core.action_size))
    assert task.succeeded() and task.reward() == 1.0
