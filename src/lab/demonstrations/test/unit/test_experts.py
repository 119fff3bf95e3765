# SPDX-License-Identifier: BSD-3-Clause
"""Experts do their tasks, disturbed or not, and what is recorded of them is done again to the last bit."""
import numpy as np
import pytest

from baxter_lab import Options
from baxter_lab.robot import Gripper
from demonstrations.card import card
from demonstrations.collecting import CollectingWork, Views, collect, film
from demonstrations.environment import RANDOMISED, Conditions, core_for, core_of, expert_of, record, replay, schema_of
from demonstrations.experts import EXPERTS, down, rotation_vector
from demonstrations.frames import ACTION, EXPERT_ACTION, STATE, DemonstrationError
from demonstrations.reading import DataSet
from demonstrations.writing import SetWriter
from gym_baxter.randomised import Randomised

PLAIN = Options(with_meshes=False)


@pytest.mark.parametrize("task", EXPERTS)
def test_an_expert_does_its_task_and_the_record_is_replayed_to_the_last_bit(task, tmp_path):
    core = core_of(task)  # fingers of boxes do not hold
    episode = record(core, expert_of(core), 3)
    assert episode.success and len(episode) < 150
    with SetWriter(tmp_path, schema_of(core)) as writer:
        writer.add(episode)
    found = DataSet(tmp_path).episode(0)
    record(core, expert_of(core), 4)  # something else between
    assert replay(core, found) == {STATE: 0.0, "observation.environment_state": 0.0}
    found.columns[ACTION] = found.columns[ACTION] + np.float32(1e-3)
    assert replay(core, found)[STATE] > 0.0
    core.close()


def test_an_expert_does_no_other_task():
    core = core_of("Reach")
    with pytest.raises(ValueError, match="PickPlaceExpert does PickPlace; found 'Reach'"):
        EXPERTS["PickPlace"](core)
    core.close()


@pytest.mark.parametrize("seed", [100000, 100004])
def test_hands_close_on_a_pot_together(seed):
    """One that closes first pulls the pot away from the other: these seeds failed."""
    core = core_of("TwoArmLift")
    episode = record(core, expert_of(core), seed, noise=1.0)
    left, right = episode.columns[EXPERT_ACTION][:, [6, 13]].T
    assert episode.success and left.max() > 0.0
    np.testing.assert_array_equal(left, right)
    core.close()


def test_a_handover_follows_from_what_policies_see(monkeypatch):
    """A gripper says that it holds something a while after its fingers have stopped, and policies do not see it: those
    that learned from an expert that waited for it held on to the hammer."""
    core = core_of("TwoArmHandover")
    expert, done, closed = expert_of(core), False, []
    core.reset(np.random.default_rng(3))
    expert.begin()
    while not done and len(closed) < 150:
        wanted = expert.act()
        for says in (False, True):
            with monkeypatch.context() as patch:
                patch.setattr(Gripper, "holds", property(lambda gripper, says=says: says))
                np.testing.assert_array_equal(expert.act(), wanted)
        closed.append((core.lab.robot.left.gripper.position, wanted[[6, 13]] > 0.0))
        done = core.step(wanted).succeeded
    assert done
    on_handle = [both for position, both in closed if position < closed[-1][0] + 2.0]
    assert len(on_handle) >= 3  # so often is it shown
    np.testing.assert_array_equal(on_handle, [(True, False)] * len(on_handle))
    core.close()


@pytest.mark.parametrize("seed", [100013, 100020])
def test_a_disturbed_handover_succeeds(seed):
    """The right gripper lost its grip for a moment, opened, and the hammer fell: these seeds failed."""
    core = core_of("TwoArmHandover")
    assert record(core, expert_of(core), seed, noise=1.0).success
    core.close()


def test_an_expert_is_gentle_with_arms_that_lag():
    """At the speed for ideal drives the hand swung into the block, and the robot stopped the arm."""
    core = core_of("PickPlace", **Conditions("robot").choices)
    episode = record(core, expert_of(core), 0)
    assert episode.success and not core.lab.robot.simulated.baxter.halted("left") and len(episode) < 300
    core.close()


def test_conditions_are_recorded_and_are_those_of_a_replay(tmp_path):
    conditions = Conditions.named("robot", True)
    assert collect("Reach", tmp_path, [5], conditions=conditions).kept == 1
    data = DataSet(tmp_path)
    assert Conditions.of(data.schema.about) == conditions and "| profile | robot |" in card(data)
    core = core_for(data.schema)
    assert core.choices.randomised == Randomised(**RANDOMISED) and "lag" in core.lab.robot.simulated.chosen
    assert replay(core, data.episode(0)) == {STATE: 0.0, "observation.environment_state": 0.0}
    core.close()
    with pytest.raises(DemonstrationError, match="profile is robot, that of new episodes is the usual one"):
        collect("Reach", tmp_path, [6])
    assert len(DataSet(tmp_path)) == 1


def test_usual_conditions_are_those_of_sets_that_name_none():
    core = core_of("Reach", **Conditions().choices)
    assert schema_of(core).about.keys() == {"task", "control", "robosuite_order"}
    assert Conditions.of({}) == Conditions() == Conditions.named("sim", False)
    core.close()


def test_what_an_expert_wants_is_beside_what_was_done():
    core = core_of("Reach", options=PLAIN)
    episode = record(core, expert_of(core), 1, noise=1.0)
    done, wanted = episode.columns[ACTION], episode.columns[EXPERT_ACTION]
    assert episode.success and not np.array_equal(done, wanted)
    np.testing.assert_array_equal(done[:, [6, 13]], wanted[:, [6, 13]])  # grippers are not disturbed
    again = record(core, expert_of(core), 1, noise=1.0)
    np.testing.assert_array_equal(again.columns[ACTION], done)
    core.close()


def test_a_set_is_the_same_with_any_number_of_workers(tmp_path):
    sets = []
    for workers in (1, 2):
        found = collect("Reach", tmp_path / str(workers), range(2), work=CollectingWork(workers))
        assert (found.kept, found.failed) == (2, 0)
        sets.append([DataSet(tmp_path / str(workers)).episode(number) for number in range(2)])
    for one, other in zip(*sets, strict=True):
        assert one.seed == other.seed
        np.testing.assert_array_equal(one.columns[STATE], other.columns[STATE])


def test_a_set_has_the_pictures_of_its_cameras(tmp_path):
    assert film("Reach", tmp_path, [0], Views(("head",), 32)).kept == 1
    data = DataSet(tmp_path)
    assert data.schema.features["observation.images.head"].shape == (32, 32, 3)
    data.check(0)
    pictures = list(data.pictures(0, "observation.images.head"))
    assert len(pictures) == len(data.episode(0)) and np.std(pictures[0]) > 10.0


def test_unknown_tasks_and_cameras_are_named():
    with pytest.raises(DemonstrationError, match="PickPlace"):
        core_of("Juggle")
    with pytest.raises(DemonstrationError, match="left_hand"):
        core_of("Reach", cameras=("left",))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 3.0, np.pi])
def test_a_turn_is_its_axis_times_its_angle(angle):
    assert np.linalg.norm(rotation_vector(down(angle) @ down(0.0).T)) == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("about", [
    {"profile": "xyz"}, {"profile": 3}, {"profile": []}, {"randomised": "abc"}, {"randomised": None},
    {"randomised": {"foo": 1}}, {"randomised": {"mass": "x"}}, {"randomised": {"mass": -3}},
    {"randomised": {"mass": float("nan")}}])
def test_conditions_of_a_broken_set_are_refused_with_what_was_found(about):
    with pytest.raises(DemonstrationError, match=next(iter(about)) + "|mass|real number"):
        Conditions.of(about)
