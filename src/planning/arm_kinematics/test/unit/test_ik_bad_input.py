# SPDX-License-Identifier: BSD-3-Clause
"""Invalid poses, postures and chains are refused with a message; an incomplete map is continued or refused."""
import json
import math
import pickle

import numpy as np
import pytest

from arm_kinematics import (
    Budget,
    Chain,
    ChainError,
    InvalidPosture,
    InvalidTarget,
    NoSolution,
    Several,
    Target,
    Targets,
    pose_from_quaternion,
    solve,
    solve_all,
    solve_batch,
)
from arm_kinematics.reach import MapSettings, ReachError, compute
from urdf_model import parse_urdf
from urdf_model.transforms import rigid, rpy_matrix

_LIMIT = "<limit lower='-2' upper='2' effort='1' velocity='1'/>"


def serial(kinds):
    """A chain of joints of these types, their axes in turns z, y, x. A type may be (type, more XML)."""
    parts = []
    for i, kind in enumerate(kinds):
        kind, more = kind if isinstance(kind, tuple) else (kind, "" if kind == "continuous" else _LIMIT)
        parts.append("<link name='l%d'/><joint name='j%d' type='%s'><parent link='l%d'/><child link='l%d'/>"
                     "<origin xyz='0.1 0.02 0.1'/><axis xyz='%s'/>%s</joint>"
                     % (i, i, kind, i, i + 1, ("0 0 1", "0 1 0", "1 0 0")[i % 3], more))
    text = "<robot name='serial'>%s<link name='l%d'/></robot>" % ("".join(parts), len(kinds))
    return Chain.from_robot(parse_urdf(text, source="serial"), "l0", "l%d" % len(kinds))


@pytest.mark.parametrize("kinds", [
    ["revolute"], ["prismatic"], ["revolute"] * 3, ["continuous"] * 6, ["prismatic", "revolute", "continuous"],
    ["revolute", "revolute", "prismatic", "continuous"] * 3, ["revolute"] * 20,
], ids=lambda kinds: "%d %s" % (len(kinds), kinds[0]))
def test_chain_of_any_length_and_kind_finds_its_own_poses(kinds):
    chain = serial(kinds)
    rng = np.random.default_rng(41)
    low, high = np.maximum(chain.lower, -math.pi), np.minimum(chain.upper, math.pi)
    for q in rng.uniform(low, high, (10, len(chain))):
        found = solve(chain, chain.fk(q), chain.mid_range).q
        np.testing.assert_allclose(chain.fk(found), chain.fk(q), atol=1e-5)
        assert (found >= chain.lower).all() and (found <= chain.upper).all()
    with pytest.raises(NoSolution, match="out of reach"):
        solve(chain, rigid(np.eye(3), (100.0, 0.0, 0.0)), chain.mid_range)


@pytest.mark.parametrize("kind, text", [
    (("planar", ""), "j1.*is planar"), (("floating", ""), "j1.*is floating"),
    (("revolute", _LIMIT + "<mimic joint='j0'/>"), "j1.*mimics another"),
])
def test_joint_that_no_chain_has_is_refused(kind, text):
    with pytest.raises(ChainError, match=text):
        serial(["revolute", kind, "revolute"])


@pytest.mark.parametrize("change", [
    lambda pose: pose.T, lambda pose: pose * np.nan, lambda pose: pose[:3], lambda pose: 2.0 * pose,
    lambda pose: pose @ np.diag([1.0, 1.0, -1.0, 1.0]), lambda pose: "pose", lambda pose: [[1, 2], [3]],
    lambda pose: None, lambda pose: np.where(pose == pose[0, 3], np.inf, pose),
], ids=["transposed", "nan", "three rows", "scaled", "mirrored", "text", "ragged", "none", "infinite"])
def test_what_is_no_pose_is_refused(left, change):
    pose = change(rigid(rpy_matrix(0.1, 0.2, 0.3), (0.7, 0.2, 0.1)))
    with pytest.raises(InvalidTarget, match="target must"):
        solve(left, pose, left.mid_range)
    with pytest.raises(InvalidTarget, match="target"):
        solve_batch(left, [pose], left.mid_range)


@pytest.mark.parametrize("position, turn", [
    ((0, 0), (0, 0, 0, 1)), ((0, 0, 0), (0, 0, 1)), ((0, 0, 0, 0), (0, 0, 1)), ((0, 0, 0), (0, 0, 0, None)),
    ((0, 0, 0), "none"), ((0, "x", 0), (0, 0, 0, 1)), ((0, 0, math.nan), (0, 0, 0, 1)), (None, (0, 0, 0, 1)),
    ((0, 0, 0), (0, 0, 0, 2)), ((0, 0, 0), (0, 0, 0, 0)),
    ((10 ** 400, 0, 0), (0, 0, 0, 1)), ((0, 0, 0), (0, 0, 0, 10 ** 400)),
])
def test_what_is_no_quaternion_is_refused(position, turn):
    with pytest.raises(InvalidTarget):
        pose_from_quaternion(position, turn)


@pytest.mark.parametrize("option", [
    {"max_starts": math.inf}, {"max_starts": 0}, {"max_iterations": math.nan}, {"candidates": math.inf},
    {"tolerance_m": math.nan}, {"tolerance_rad": 0.0},
], ids=str)
def test_budget_with_which_nothing_is_found_is_refused(option):
    name, value = *option, *option.values()
    with pytest.raises(ValueError, match="%s must be .*, got %s" % (name, value)):
        Budget(**option)


@pytest.mark.parametrize("axis", ["z", (0, 1), (math.inf, 0, 0), (0, 0, 0)], ids=str)
def test_axis_that_is_no_direction_is_refused(left, axis):
    pose = left.fk(left.mid_range)
    for make in (lambda: Target(pose, free_axis=axis), lambda: Targets([pose], free_axis=axis)):
        with pytest.raises(ValueError, match="the free axis must be a direction"):
            make()


def test_number_of_solutions_and_their_gap_are_numbers(left):
    for options in ({"number": math.inf}, {"number": 0}, {"number": 2, "apart": math.nan}):
        with pytest.raises(ValueError, match="must be"):
            Several(**options)
    with pytest.raises(ValueError, match="number of solutions must be finite and at least 1, got 0"):
        solve_all(left, left.fk(left.mid_range), left.mid_range, 0)


def test_batch_of_nothing_is_nothing(left):
    assert solve_batch(left, [], left.mid_range).q.shape == (0, 7)


def test_errors_survive_the_way_between_processes(left):
    with pytest.raises(NoSolution) as failure:
        solve(left, rigid(np.eye(3), (9.0, 0.0, 0.0)), left.mid_range)
    for error in (failure.value, InvalidTarget("no pose", 3), InvalidPosture("no posture", None), ReachError("no map")):
        back = pickle.loads(pickle.dumps(error))
        assert type(back) is type(error) and str(back) == str(error)
        assert set(vars(back)) == set(vars(error))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(failure.value)).best, failure.value.best)


# -- reachability maps -----------------------------------------------------------------------------------------------


def settings(**changes):
    values = {"lower": (0.5, 0.0, 0.0), "upper": (0.9, 0.2, 1.0), "cell_m": 0.1, "orientations": 1, "tool": None,
              "starts": 2, "chain": "left"}
    return MapSettings(**{**values, **changes})


@pytest.mark.parametrize("change, text", [
    ({"cell_m": math.inf}, "must be positive and finite"), ({"cell_m": math.nan}, "must be positive and finite"),
    ({"cell_m": 1e-5}, "take larger cells"), ({"cell_m": 1e-320}, "take larger cells"),
    ({"tool": (math.nan, 0.0, 0.0)}, "must point somewhere"), ({"tool": (0.0, 0.0, 0.0)}, "must point somewhere"),
    ({"upper": (math.nan, 1.0, 1.0)}, "below its upper"), ({"starts": 0}, "must be positive"),
])
def test_map_that_cannot_be_is_refused(change, text):
    with pytest.raises(ReachError, match=text):
        settings(**change)


def test_part_that_was_cut_off_is_computed_again(left, tmp_path):
    several = settings(cell_m=0.05, lower=(0.5, 0.0, 0.5))
    whole = compute(left, several, tmp_path, 1)
    parts = sorted((tmp_path / "parts").glob("*.npz"))
    assert len(parts) == 3  # of 320 cells
    parts[0].write_bytes(parts[0].read_bytes()[:100])
    parts[1].write_bytes(b"")
    done = []
    again = compute(left, several, tmp_path, 1, lambda cells, total: done.append(cells))
    assert done[0] == 64 and done[-1] == 320  # the last part has 64
    np.testing.assert_array_equal(whole.reached, again.reached)
    np.testing.assert_array_equal(whole.manipulability, again.manipulability)


@pytest.mark.parametrize("note", ["", "{", "[]", "{}", json.dumps({"lower": [0, 0, 0]})])
def test_note_that_was_cut_off_is_named(left, tmp_path, note):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "settings.json").write_text(note)
    with pytest.raises(ReachError, match="does not say what map"):
        compute(left, settings(), tmp_path, 1)
