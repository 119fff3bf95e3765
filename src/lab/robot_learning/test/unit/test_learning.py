# SPDX-License-Identifier: BSD-3-Clause
"""A small policy learns from a small set of the real format; contracts, files and figures are checked."""
import dataclasses
import json
import os
import subprocess
import sys
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from demonstrations.environment import Conditions
from demonstrations.frames import ACTION, ENVIRONMENT, STATE, DemonstrationError, Episode, Schema, numbers
from demonstrations.reading import DataSet
from demonstrations.writing import SetWriter
from robot_learning import command
from robot_learning.evaluation import Score, wilson
from robot_learning.inputs import KIND, KINDS, Inputs
from robot_learning.network import Network
from robot_learning.pictures import choose, draw_curve
from robot_learning.policy import Contract, PolicyError, Runner, load
from robot_learning.training import TrainingSettings, contract_of, train

HAND, GOAL = ("left_hand.x", "left_hand.y", "left_hand.z"), ("goal.x", "goal.y", "goal.z")
QUICK = TrainingSettings(chunk=2, hidden=(32,), steps=400, batch=64)


def small_set(folder, about=(("task", "Reach"), ("control", "osc_pose")), success=True):
    """Hands that go a third of the way to their goal with each action."""
    schema = Schema(20, {ACTION: numbers([(axis, "") for axis in "xyz"]),
                         STATE: numbers([(name, "m") for name in HAND]),
                         ENVIRONMENT: numbers([(name, "m") for name in GOAL])}, about=dict(about))
    random = np.random.default_rng(0)
    with SetWriter(folder, schema) as writer:
        for seed in range(12):
            hand, goal = random.uniform(-0.3, 0.3, (2, 3))
            rows = []
            for _ in range(20):
                action = np.clip(3.0 * (goal - hand), -1.0, 1.0)
                rows.append((action, hand, goal))
                hand = hand + 0.1 * action
            columns = {key: np.array([row[n] for row in rows], dtype=np.float32)
                       for n, key in enumerate((ACTION, STATE, ENVIRONMENT))}
            writer.add(Episode("Reach.", columns, success, seed))
    return DataSet(folder)


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    return train(small_set(tmp_path_factory.mktemp("set")), QUICK, {"by": "a test"})


def test_a_policy_learns_to_go_to_the_goal(learned):
    policy, curve = learned
    assert curve.validation[-1] < 0.15 and curve.steps[-1] == QUICK.steps
    runner, hand, goal = Runner(policy), np.array((0.2, -0.1, 0.1)), np.array((-0.1, 0.2, 0.0))
    for _ in range(30):
        hand = hand + 0.1 * runner.act([*hand, *goal])
    assert np.linalg.norm(hand - goal) < 0.03


def test_the_same_set_gives_the_same_policy(learned, tmp_path):
    again, _ = train(small_set(tmp_path), QUICK)
    for one, other in zip(learned[0].network.layers, again.network.layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])


def test_a_file_holds_the_policy_and_its_contract(learned, tmp_path):
    policy = learned[0]
    policy.save(tmp_path / "policy.npz")
    found = load(tmp_path / "policy.npz")
    seen = np.random.default_rng(1).uniform(-0.3, 0.3, (5, 6))
    np.testing.assert_array_equal(found.chunks(seen), policy.chunks(seen))
    assert found.contract == policy.contract and found.contract.made == {"by": "a test"}
    assert found.contract.observation == (*HAND, *GOAL) and found.contract.units == ("m",) * 6


@pytest.mark.parametrize("content", [b"", b"half", None])
def test_what_is_no_policy_is_refused(tmp_path, content):
    path = tmp_path / "policy.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(PolicyError, match="policy.npz"):
        load(path)


def test_a_file_that_is_cut_off_and_arrays_without_a_contract_are_refused(learned, tmp_path):
    learned[0].save(tmp_path / "whole.npz")
    (tmp_path / "half.npz").write_bytes((tmp_path / "whole.npz").read_bytes()[:2000])
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    for name in ("half.npz", "other.npz"):
        with pytest.raises(PolicyError, match=name):
            load(tmp_path / name)


@pytest.mark.parametrize(("name", "value", "text"), [
    ("input_mean", np.full(12, np.nan), "input_mean has nan at place 0"),
    ("input_scale", np.zeros(12), "12 finite numbers above 0"),
    ("input_mean", np.zeros(3), "12 finite"), ("action_scale", np.full(3, np.inf), "action_scale"),
    ("action_mean", np.array(["a"] * 3), "action_mean"), ("weights_0", np.zeros(12), "layer 0"),
    ("weights_1", np.zeros((5, 3)), "layer 1"), ("offsets_0", np.zeros(3), "layer 0"),
    ("weights_0", np.full((12, 8), 1e300), "layer 0 has weights that are not finite")])
@pytest.mark.filterwarnings("ignore:overflow encountered in cast")
def test_numbers_that_would_give_no_action_are_refused(learned, tmp_path, name, value, text):
    path = tmp_path / "policy.npz"
    small = dataclasses.replace(learned[0], network=Network.random(
        (12, 8, 2 * len(learned[0].contract.action)), np.random.default_rng(0)))
    small.save(path)
    with np.load(path) as file:
        np.savez(path, **{**{key: file[key] for key in file.files}, name: value})
    with pytest.raises(PolicyError, match="policy.npz: .*" + text):
        load(path)


@pytest.mark.parametrize(("change", "text"), [
    ({"rate_hz": 0}, "rate_hz is 0"), ({"rate_hz": "x"}, "rate_hz"), ({"chunk": 2.0}, "chunk is 2.0"),
    ({"task": ["Reach"]}, "task is"), ({"units": ["m"]}, "1 units for 6"), ({"observation": "abc"}, "list of texts"),
    ({"robosuite_order": "yes"}, "true or false")])
def test_a_contract_that_cannot_be_is_refused(learned, tmp_path, change, text):
    path = tmp_path / "policy.npz"
    learned[0].save(path)
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files}
    arrays["contract"] = np.array(json.dumps({**json.loads(str(arrays["contract"])), **change}))
    np.savez(path, **arrays)
    with pytest.raises(PolicyError, match=text):
        load(path)


def test_a_policy_that_says_nan_is_stopped(learned):
    class Says(NamedTuple):
        contract: Contract

        def chunks(self, observations):
            return np.full((len(observations), self.contract.chunk, len(self.contract.action)), np.nan)

    with pytest.raises(PolicyError, match="not finite"):
        Runner(Says(learned[0].contract)).act(np.zeros(6))


@pytest.mark.parametrize(("found", "text"), [
    ({"rate_hz": 10}, "needs rate_hz 20; here it is 10"), ({"control": "joint_pos"}, "osc_pose"),
    ({"observation": (*HAND, "goal.x", "goal.z", "goal.y")}, "number 4 of the observation is 'goal.y'"),
    ({"observation": HAND}, "needs 6 numbers as observation; here are 3")])
def test_the_first_difference_from_the_contract_is_named(learned, found, text):
    with pytest.raises(PolicyError, match=text):
        learned[0].contract.require(**found)


def test_observations_that_are_not_finite_are_refused(learned):
    with pytest.raises(PolicyError, match="6 finite numbers"):
        Runner(learned[0]).act([np.nan] * 6)


def test_sets_without_a_task_or_without_successes_are_refused(tmp_path):
    with pytest.raises(DemonstrationError, match="task"):
        contract_of(small_set(tmp_path / "a", about=()), 2)
    with pytest.raises(DemonstrationError, match="on the robot, not in an environment"):
        contract_of(small_set(tmp_path / "c", about=(("task", "on the robot"), ("control", "positions"))), 2)
    with pytest.raises(DemonstrationError, match="no successful episode"):
        train(small_set(tmp_path / "b", success=False), QUICK)


def test_weights_of_another_size_do_not_fit_the_contract(learned):
    with pytest.raises(PolicyError, match="the network goes from"):
        dataclasses.replace(learned[0], network=Network.random((5, 8, 6), np.random.default_rng(0)))


def test_gradients_are_those_of_finite_differences():
    random = np.random.default_rng(0)
    network = Network.random((4, 6, 5, 3), random)
    inputs, wanted, share = (random.standard_normal((7, n)).astype(np.float32) for n in (4, 3, 3))
    values = [array for layer in network.layers for array in layer]
    for value in values:
        value += 0.1 * random.standard_normal(value.shape)  # rectifiers away from their edge
    _, gradients = network.gradients(inputs, wanted, share**2)
    for value, gradient in zip(values, gradients, strict=True):
        at, step = (0,) * value.ndim, np.float32(1e-3)
        losses = []
        for sign in (1.0, -1.0):
            value[at] += sign * step
            losses.append(network.gradients(inputs, wanted, share**2)[0])
            value[at] -= sign * step
        assert gradient[at] == pytest.approx((losses[0] - losses[1]) / (2 * step), abs=2e-3)


def test_products_are_computed_in_one_thread():
    """Several wait for each other busily: a step of training took twelve times the processor time beside other work."""
    program = ("import os, sys; sys.path[:0] = %r; import numpy as np; before = len(os.listdir('/proc/self/task')); "
               "from robot_learning import network; one = np.ones((300, 300), np.float32); network.product(one, one); "
               "assert 'OPENBLAS_NUM_THREADS' not in os.environ; "
               "sys.exit(len(os.listdir('/proc/self/task')) - before)" % sys.path)
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    assert subprocess.run([sys.executable, "-c", program], env=environment, timeout=60).returncode == 0


def test_a_quaternion_and_its_negative_are_the_same_input():
    names = ["block.%s" % part for part in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    row = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.6, 0.8])
    inputs = Inputs(names, False)
    one, other = inputs.of(row[None]), inputs.of(np.concatenate([row[:3], -row[3:]])[None])
    np.testing.assert_array_equal(one, other)
    assert one.shape == (1, len(inputs)) == (1, 9)
    np.testing.assert_allclose(one[0, 3:6], (1.0 - 2.0 * 0.36, 2.0 * 0.48, 0.0), atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_hand_sees_things_the_same_wherever_it_is_and_turns(kind):
    """Inputs of the newest kind, not of the one before, which files of earlier versions name."""
    names = ["%s.%s" % (thing, part) for thing in ("left_hand", "block")
             for part in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    block, turn, moved = (0.1, -0.02, 0.3), Rotation.from_euler("xyz", (0.2, -0.4, 1.0)), np.array((0.5, 0.1, 0.2))
    inputs, rows = Inputs(names, False, kind), []
    for hand in (Rotation.identity(), Rotation.from_euler("xyz", (2.0, 0.3, -0.7))):
        rows.append([*moved, *hand.as_quat(), *(moved + hand.apply(block)), *(hand * turn).as_quat()])
    one, other = inputs.of(np.array(rows))
    assert len(one) == len(inputs) == (36 if kind == KIND else 24)
    if kind == KIND:
        np.testing.assert_allclose(one[-12:], other[-12:], atol=1e-6)
        np.testing.assert_allclose(one[-12:-3], [*turn.as_matrix()[:, 0], *turn.as_matrix()[:, 1], *block], atol=1e-6)


def test_speeds_are_no_inputs_and_angles_only_of_joint_policies():
    names = ["left_s0.pos", "left_s0.vel", "left_gripper.open"]
    assert len(Inputs(names, False)) == 1 and len(Inputs(names, True)) == 2


@pytest.mark.parametrize(("good", "count", "low", "high"), [
    (95, 100, 0.888, 0.978), (0, 10, 0.0, 0.278), (100, 100, 0.963, 1.0)])
def test_confidence_intervals_are_wilsons(good, count, low, high):
    assert wilson(good, count) == (pytest.approx(low, abs=1e-3), pytest.approx(high, abs=1e-3))


def test_a_score_counts_episodes_that_did_not_run_as_failures():
    score = Score({0: {"success": True}, 1: {"success": False}, 2: {"success": True}}, {3: "no"})
    assert (score.successes, score.count) == (2, 4) and "2 of 4" in str(score)
    assert choose(score) == [0, 2, 1]


@pytest.mark.parametrize(("good", "status", "text"), [(80, 0, "passed: 80 of 100 points"), (79, 3, "not passed: 79")])
def test_the_judge_plays_hidden_seeds(tmp_path, monkeypatch, capsys, learned, good, status, text):
    played = []

    def evaluated(path, seeds, *_, **__):
        played.append(list(seeds))
        return Score({seed: {"success": row < good, "steps": 1} for row, seed in enumerate(played[-1])}, {})

    monkeypatch.setattr(command, "evaluate", evaluated)
    learned[0].save(tmp_path / "policy.npz")
    words = ["Reach", "--judge", str(tmp_path / "policy.npz"), "--out", str(tmp_path), "--no-film"]
    assert [command.main(words) for _ in range(2)] == [status, status] and text in capsys.readouterr().out
    assert played[0] != played[1] and len(played[0]) == 100
    assert min(min(played)) > command.FIRST_CORRECTION + 100 * command.MAX_CORRECTIONS  # of no demonstration
    assert command.main(["PickPlace", *words[1:]]) == 1 and "'Reach'" in capsys.readouterr().err
    for more in (["--evaluate", "p"], ["--episodes", "1"], ["--data", str(tmp_path)]):
        with pytest.raises(SystemExit):
            command.parse([*words, *more])


def test_what_is_measured_leaves_what_was_learned_alone(tmp_path, monkeypatch, learned):
    """Its score and film took the place of the learned policy's own, and another task's policy passed for it."""
    monkeypatch.setattr(command, "evaluate", lambda *_, **__: Score({0: {"success": True, "steps": 1}}, {}))
    monkeypatch.setenv("LAB_ROOT", str(tmp_path))
    learned[0].save(tmp_path / "policy.npz")
    words = ["--evaluate", str(tmp_path / "policy.npz"), "--no-film"]
    assert command.main(words) == 0 and command.main([*words, "--profile", "robot"]) == 0
    assert sorted(path.name for path in (tmp_path / ".baxter/learned").iterdir()) == [
        "Reach-evaluated", "Reach-robot-evaluated"]
    assert command.main(["PickPlace", *words]) == 1


def test_a_film_shows_the_conditions_that_were_measured(tmp_path, monkeypatch, learned):
    seen = []

    class Filmed:
        def close(self):
            seen.append("closed")

    monkeypatch.setattr(command, "evaluate", lambda *_, **__: Score({0: {"success": True, "steps": 1}}, {}))
    monkeypatch.setattr(command, "core_for", lambda contract, **choices: seen.append(choices) or Filmed())
    monkeypatch.setattr(command, "film", lambda *_: None)
    learned[0].save(tmp_path / "policy.npz")
    words = ["--evaluate", str(tmp_path / "policy.npz"), "--profile", "robot", "--randomised", "--out", str(tmp_path)]
    assert command.main(words) == 0
    assert seen == [Conditions("robot", {"mass": 0.5, "friction": 0.5}).choices, "closed"]


def test_as_much_is_learned_from_as_is_asked_for(tmp_path, monkeypatch):
    """Of a folder with more demonstrations, and rounds of corrections, all were taken without a word."""
    first, round_ = command.FIRST_DEMONSTRATION, command.FIRST_CORRECTION
    data = SimpleNamespace(seeds=[first, first + 1, first + 7, round_, round_ + command.MAX_CORRECTIONS, None],
                           __len__=lambda self: 6)
    for words, wanted in ((["--demonstrations", "2"], [0, 1, 5]), (["--demonstrations", "8"], [0, 1, 2, 5]),
                          (["--rounds", "1"], [0, 1, 2, 3, 5])):
        assert command._chosen(command.parse(["Reach", *words]), data) == wanted


def test_a_set_of_another_task_is_not_learned_from(tmp_path, capsys):
    small_set(tmp_path / "set")
    out = tmp_path / "out"
    words = ["--data", str(tmp_path / "set"), "--out", str(out), "--steps", "5", "--episodes", "0"]
    assert command.main(["PickPlace", *words]) == 1 and "of Reach, not of PickPlace" in capsys.readouterr().err
    # It is none of the environment either, which is told before it is learned from.
    assert command.main(["Reach", *words]) == 1 and "number 0 of the observation" in capsys.readouterr().err
    assert not (out / command.POLICY).exists()


def with_names(data, names):
    schema = data.schema
    state = dataclasses.replace(schema.features[STATE], names=names)
    data.schema = dataclasses.replace(schema, features={**schema.features, STATE: state})
    return data


def test_sets_that_no_policy_can_learn_from_are_refused_before_it_learns(tmp_path):
    with pytest.raises(DemonstrationError, match=r"names goal.x more than once"):
        contract_of(with_names(small_set(tmp_path / "twice"), ("goal.x", "left_hand.y", "left_hand.z")), 2)
    with pytest.raises(DemonstrationError, match=r"task \['Reach'\]"):
        contract_of(small_set(tmp_path / "no text", about=(("task", ["Reach"]), ("control", "osc_pose"))), 2)
    data = small_set(tmp_path / "nan")
    sound = data.episode

    def broken(number):
        episode = sound(number)
        episode.columns[STATE] = np.full_like(episode.columns[STATE], np.nan)
        return episode

    data.episode = broken
    with pytest.raises(DemonstrationError, match="not finite"):
        train(data, QUICK)


@pytest.mark.parametrize("name", ["score.json", "policy.npz", "picture.png"])
def test_what_is_no_npz_is_said_to_be_none(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x89PNG" * 100)
    with pytest.raises(PolicyError, match="no npz"):
        load(tmp_path / name)


def test_a_curve_becomes_a_picture(learned, tmp_path):
    from PIL import Image

    draw_curve(learned[1], "small", tmp_path / "curve.png")
    with Image.open(tmp_path / "curve.png") as picture:
        assert picture.size == (720, 420) and len(picture.convert("RGB").getcolors(10**6)) > 4
