# SPDX-License-Identifier: BSD-3-Clause
"""Maps of reach: what counts as reached, their files, and the commands that make and use them."""
import csv
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from arm_kinematics import Chain, reach, solve
from arm_kinematics.reach import MapSettings
from arm_kinematics.reach_map import ReachMap, overlap
from arm_kinematics.reach_places import Region, best_places, table_poses
from urdf_model.transforms import matrix_from_quaternion, quaternion_from_matrix, rigid, rpy_matrix

PACKAGE = Path(__file__).resolve().parents[2]
BAXTER = PACKAGE.parents[1] / "baxter_common/baxter_description/urdf/baxter.urdf"
BAXTER_ARM = ("--urdf", str(BAXTER), "--base", "base", "--tip", "left_gripper")


def command(name, *arguments, **options):
    return subprocess.Popen([sys.executable, str(PACKAGE / "scripts" / name), *arguments], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, **options)


def run(name, *arguments):
    """Return (exit status, standard output, standard error)."""
    process = command(name, *arguments)
    out, err = process.communicate(timeout=300)
    return process.returncode, out, err


def reach_arguments(folder, *more):
    return ("reach", *BAXTER_ARM, "--volume", "0.3", "1.1", "-0.2", "0.6", "-0.2", "0.6", "--cell", "0.1",
            "--orientations", "6", "--out", str(folder), *more)


def test_map_is_written_as_data_and_picture(tmp_path, left):
    status, out, err = run(*reach_arguments(tmp_path, "--tool", "0", "0", "-1", "--jobs", "2"))
    assert status == 0, err
    assert "100 % of 512 cells" in err
    data = np.load(tmp_path / "reach.npz")
    share, manipulability = data["share"], data["manipulability"]
    assert share.shape == manipulability.shape == (8, 8, 8)
    assert 0.2 < share.mean() < 1.0
    assert (np.isnan(manipulability) == (share == 0.0)).all()
    rows = list(csv.DictReader(open(tmp_path / "reach.csv")))
    assert len(rows) == 512
    for row, part in zip(rows, share.ravel(), strict=True):
        assert float(row["reached_percent"]) == pytest.approx(100 * part, abs=0.01)
    # One cell by hand: its centre, gripper down.
    best = rows[int(np.argmax(share))]
    down = rigid(np.diag([1.0, -1.0, -1.0]), [float(best[axis]) for axis in ("x_m", "y_m", "z_m")])
    solve(left, down, left.mid_range)
    picture = cv2.imread(str(tmp_path / "reach.png"))
    assert picture is not None and min(picture.shape[:2]) > 200 and len(np.unique(picture.reshape(-1, 3), axis=0)) > 8


def test_interrupted_map_goes_on_where_it_was(tmp_path):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert run(*reach_arguments(whole))[0] == 0
    first = command(*reach_arguments(broken, "--jobs", "1"), start_new_session=True)
    for line in first.stderr:  # a line each tenth
        if not line.startswith("0 %"):
            break
    os.killpg(first.pid, signal.SIGINT)
    _, err = first.communicate(timeout=300)
    assert "Traceback" not in err
    kept = {path: path.stat().st_mtime_ns for path in (broken / "parts").glob("0*.npz")}
    assert kept
    assert not (broken / "reach.npz").exists() or len(kept) == 4
    status, _, err = run(*reach_arguments(broken))
    assert status == 0, err
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    for name in ("share", "manipulability"):
        np.testing.assert_array_equal(np.load(broken / "reach.npz")[name], np.load(whole / "reach.npz")[name])
    # Another map does not mix with it.
    status, _, err = run(*reach_arguments(broken, "--starts", "7"))
    assert status == 1 and "another starts (40 there)" in err


def test_map_of_a_planar_arm_is_the_ring_that_it_should_be(tmp_path):
    """Two links of 1 m and 0.6 m and a hand that turns freely: the ring from 0.4 m to 1.6 m, in the plane only."""
    joints = [(0, 0, 0), (1.0, 0, 0), (0.6, 0, 0)]
    chain = Chain("base", "tip", [("j%d" % i, "continuous", "l%d" % i, rigid(np.eye(3), origin), (0, 0, 1), None, None)
                                  for i, origin in enumerate(joints)]
                  + [("end", "fixed", "tip", rigid(np.eye(3), (0, 0, 0)), (0, 0, 1), None, None)])
    settings = reach.MapSettings((-1.8, -1.8, -0.1), (1.8, 1.8, 0.1), 0.2, 5, (0.0, 0.0, 1.0), 30, "ring")
    share = reach.compute(chain, settings, tmp_path, 2).reached.mean(axis=1).reshape(settings.shape)
    radius = np.linalg.norm(settings.centres()[:, :2], axis=1).reshape(settings.shape)
    inside = (radius > 0.45) & (radius < 1.55)
    outside = (radius < 0.35) | (radius > 1.65)
    assert settings.shape == (18, 18, 1)
    assert (share[inside] == 1.0).all()
    assert (share[outside] == 0.0).all()


def test_orientations_are_rotations_and_tools_point_where_they_should():
    for tool in (None, (0.3, -0.4, 1.0), (0, 0, -1)):
        settings = reach.MapSettings((0, 0, 0), (1, 1, 1), 0.5, 30, tool, 1, "")
        for rotation in settings.rotations():
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
            assert np.linalg.det(rotation) == pytest.approx(1.0)
            if tool is not None:
                np.testing.assert_allclose(rotation[:, 2], np.array(tool) / math.dist(tool, (0, 0, 0)), atol=1e-12)


class Touches:
    """A checker of the postures in which the joint s0 is above zero."""

    def contact(self, joint_names, q):
        return "a touch" if q[0] > 0.0 else None

    def contact_and_cause(self, joint_names, q):
        return self.contact(joint_names, q), False


def test_postures_with_contacts_do_not_count(tmp_path, left):
    """The checker forbids half of the first joint's range, so poses need other postures, or are lost."""
    settings = reach.MapSettings((0.3, -0.2, 0.0), (1.1, 1.0, 0.2), 0.2, 8, None, 40, "left", True)
    every = reach.part_values(left, settings, 0).reached
    free = reach.part_values(left, settings, 0, Touches())
    assert (free.reached <= every).all() and 0.0 < free.reached.mean() < every.mean()
    assert (np.isnan(free.manipulability) == ~free.reached.any(axis=1)).all()
    values = reach.compute(left, settings, tmp_path, 2, new_checker=Touches)
    np.testing.assert_array_equal(values.reached, free.reached)
    with pytest.raises(reach.ReachError, match="needs a collision checker"):
        reach.compute(left, settings, tmp_path, 2)


def test_cells_in_parts_are_the_cells_of_the_whole():
    settings = reach.MapSettings((-0.4, 0.1, 0.3), (0.5, 1.0, 0.9), 0.08, 4, None, 1, "")
    whole = settings.centres()
    parts = [settings.centres(first, size) for first, size in settings.parts().items()]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert len(whole) == np.prod(settings.shape) and (whole[1] - whole[0])[2] == pytest.approx(0.08)


def test_map_without_self_collisions_by_command(tmp_path):
    status, _, err = run("reach", "--volume", "0.0", "0.8", "0.0", "0.8", "-0.1", "0.3", "--cell", "0.4",
                         "--orientations", "6", "--self-collision", "--jobs", "1", "--out", str(tmp_path))
    assert status == 0, err
    data = np.load(tmp_path / "reach.npz")
    assert data["self_collision"] and 0.0 < data["share"].mean() < 0.9


# -- maps as data


def small_map(reached, rotations=None):
    """A map of cells of 0.1 m from (0.2, -0.1, 0) on, with two orientations, x and y of the tip reversed."""
    rotations = np.array([np.eye(3), rpy_matrix(0.0, 0.0, math.pi)]) if rotations is None else rotations
    manipulability = np.where(reached.any(axis=3), 0.5, math.nan)
    return ReachMap(np.array([0.2, -0.1, 0.0]), 0.1, rotations, reached, manipulability, "base", "left_gripper", True)


def test_map_is_the_same_from_its_file(tmp_path):
    reached = np.random.default_rng(0).random((3, 4, 5, 11)) < 0.3
    rotations = np.array([rpy_matrix(0.1 * k, 0.0, 0.0) for k in range(11)])
    found = small_map(reached, rotations)
    found.write(tmp_path / "reach.npz")
    again = ReachMap.read(tmp_path)
    np.testing.assert_array_equal(again.reached, reached)
    np.testing.assert_array_equal(again.manipulability, found.manipulability)
    np.testing.assert_array_equal(again.centres, found.centres)
    assert (again.base, again.tip, again.self_collision) == ("base", "left_gripper", True)
    assert again.centres[0, 0, 0] == pytest.approx([0.25, -0.05, 0.05])


def test_files_that_are_no_maps_are_refused(tmp_path):
    np.savez(tmp_path / "other.npz", share=1)
    (tmp_path / "cut.npz").write_bytes((tmp_path / "other.npz").read_bytes()[:60])
    (tmp_path / "text.npz").write_text("x")
    for name, text in (("other.npz", "it has no reached"), ("cut.npz", "is cut off"), ("text.npz", "is no map")):
        with pytest.raises(reach.ReachError, match=text):
            ReachMap.read(tmp_path / name)


def test_hdf5_has_the_rows_of_reuleaux(tmp_path, monkeypatch):
    monkeypatch.setattr("arm_kinematics.reach_map._ROWS", 7)  # several portions
    reached = np.zeros((2, 2, 2, 2), dtype=bool)
    reached[0, 1, 0] = True, False
    reached[1, 1, 1] = True, True
    found = small_map(reached)
    found.write_hdf5(tmp_path / "reach.h5")
    with h5py.File(tmp_path / "reach.h5") as file:
        poses, spheres = file["Poses/poses_dataset"], file["Spheres/sphere_dataset"]
        assert poses.dtype == np.float32 and poses.shape == (3, 10)
        half = quaternion_from_matrix(found.rotations[1])
        np.testing.assert_allclose(poses[:], [(0.25, 0.05, 0.05, 0.25, 0.05, 0.05, 0, 0, 0, 1),
                                              (0.35, 0.05, 0.15, 0.35, 0.05, 0.15, 0, 0, 0, 1),
                                              (0.35, 0.05, 0.15, 0.35, 0.05, 0.15, *half)], atol=1e-6)
        np.testing.assert_allclose(spheres[:], [(0.25, 0.05, 0.05, 50.0), (0.35, 0.05, 0.15, 100.0)], atol=1e-6)
        # Reuleaux's loader finds the poses of a sphere by exact comparison of the centres.
        assert {tuple(row) for row in spheres[:, :3]} == {tuple(row) for row in poses[:, :3].astype(float)}
        assert spheres.attrs["Resolution"] == pytest.approx([0.1])


def test_a_capability_is_a_cone_where_little_is_reached_and_a_sphere_elsewhere(tmp_path):
    rotations = MapSettings((0, 0, 0), (1, 1, 1), 1.0, 20000, None, 1, "").rotations()
    axis = np.array([0.6, 0.0, -0.8])
    reached = np.zeros((4, 1, 1, 20000), dtype=bool)
    reached[0, 0, 0] = rotations[:, :, 2] @ axis >= math.cos(0.5 * math.pi / 4.5)
    reached[1, 0, 0] = rotations[:, 2, 2] > 0.0
    reached[3, 0, 0, 7] = True
    found = small_map(reached, rotations)
    found.write_capabilities(tmp_path / "capability.h5")
    with h5py.File(tmp_path / "capability.h5") as file:
        data = file["Capability/capability_dataset"]
        assert data.attrs["Resolution"] == pytest.approx([0.1]) and data.dtype == float
        cone, sphere, single = data[:]
    assert cone[:3].tolist() == [1.0, pytest.approx(100.0 * reached[0].mean()), pytest.approx(4.5, abs=0.5)]
    assert cone[3:6] == pytest.approx([0.25, -0.05, 0.05])
    np.testing.assert_allclose(matrix_from_quaternion(cone[6:])[:, 0], axis, atol=0.02)
    assert sphere == pytest.approx([2.0, 100.0 * reached[1].mean(), 0.0, 0.35, -0.05, 0.05, 0.0, 0.0, 0.0, 1.0])
    assert single[0] == 1.0 and single[2] == 10.0
    np.testing.assert_allclose(matrix_from_quaternion(single[6:])[:, 0], rotations[7, :, 2], atol=1e-9)


@pytest.mark.parametrize("directions", [[(1, 0, 0)], [(-1, 0, 0)], [(0, 0, 1), (0, 0, -1)]])
def test_the_axis_of_a_cone_is_known_in_every_direction(directions):
    rotations = np.array([rpy_matrix(0.1 * k, 0.3, 0.0) for k in range(20)])
    for k, direction in enumerate(directions):
        rotations[k, :, 2] = direction
    reached = np.zeros((1, 1, 1, 20), dtype=bool)
    reached[..., :len(directions)] = True
    row, = small_map(reached, rotations).capabilities()
    np.testing.assert_allclose(matrix_from_quaternion(row[6:])[:, 0], directions[0], atol=1e-9)


def test_a_map_in_which_nothing_is_reached_has_no_capabilities():
    assert small_map(np.zeros((2, 2, 2, 2), dtype=bool)).capabilities().shape == (0, 10)


def test_points_are_the_reached_cells_in_colours():
    reached = np.zeros((2, 2, 2, 2), dtype=bool)
    reached[0, 1, 0], reached[1, 1, 1] = (True, False), True
    table = small_map(reached).points()
    np.testing.assert_allclose(np.column_stack([table[name] for name in "xyz"]),
                               [(0.25, 0.05, 0.05), (0.35, 0.05, 0.15)], atol=1e-6)
    assert table["share"].tolist() == [0.5, 1.0] and table["manipulability"].tolist() == [0.5, 0.5]
    assert [hex(colour) for colour in table["rgb"]] == ["0xff00", "0xff"]
    assert len(small_map(np.zeros((2, 2, 2, 2), dtype=bool)).points()) == 0


def test_overlap_is_the_less_of_both_where_both_have_cells():
    one, other = np.zeros((2, 2, 2, 2), dtype=bool), np.zeros((2, 3, 2, 2), dtype=bool)
    one[0, 0, 0], one[1, 1, 1], other[0, 1, 0], other[0, 2, 0] = True, True, (True, False), True
    second = replace(small_map(other), lower=np.array([0.2, -0.2, 0.0]))  # one cell further to the right
    both = overlap(small_map(one), second)
    assert both.share.shape == (2, 2, 2) and both.share[0, 0, 0] == 0.5 and both.share.sum() == 0.5
    np.testing.assert_allclose(both.lower, (0.2, -0.1, 0.0))
    np.testing.assert_allclose(both.upper, (0.4, 0.1, 0.2))
    for lower, text in (((0.2, -0.15, 0.0), "do not coincide"), ((5.2, -0.1, 0.0), "no cell in common")):
        with pytest.raises(reach.ReachError, match=text):
            overlap(small_map(one), replace(second, lower=np.array(lower)))


def test_best_place_is_where_all_poses_are_reached():
    """Of six by six cells only a block of two by two is reached, and there one orientation of two."""
    reached = np.zeros((6, 6, 1, 2), dtype=bool)
    reached[3:5, 2:4, 0, 1] = True
    found = small_map(reached)
    poses = np.array([rigid(np.eye(3), (dx, dy, 0.0)) for dx in (-0.05, 0.05) for dy in (-0.05, 0.05)])
    region = Region((0.2, -0.1, 0.05), (0.8, 0.5, 0.05), 0.1, (0.0, math.pi))
    places = best_places(found, poses, region, most=2)
    assert places[0].share == 1.0 and places[1].share < 1.0
    assert places[0].yaw == math.pi
    np.testing.assert_allclose(places[0].position, (0.6, 0.2, 0.05), atol=0.051)
    with pytest.raises(reach.ReachError, match="too many"):
        best_places(found, poses, Region((-50, -50, -50), (50, 50, 50), 0.1))


def test_a_table_has_points_up_to_its_edges():
    poses = table_poses(0.6, 0.4, 0.1, np.array([np.eye(3), np.diag([1.0, -1.0, -1.0])]))
    assert len(poses) == 5 * 7 * 2
    assert poses[:, :3, 3].min(axis=0) == pytest.approx((-0.2, -0.3, 0.0))
    assert poses[:, :3, 3].max(axis=0) == pytest.approx((0.2, 0.3, 0.0))
    for size, text in ((0.0, "positive width and depth"), (math.inf, "positive width and depth"), (1e9, "larger step")):
        with pytest.raises(reach.ReachError, match=text):
            table_poses(size, 0.4, 0.1, np.eye(3)[None])


def test_maps_of_both_arms_overlap_and_a_table_finds_its_place(tmp_path):
    volume = ("--volume", "0.2", "1.0", "-0.6", "0.6", "-0.2", "0.2", "--cell", "0.2", "--tool", "0", "0", "-1",
              "--orientations", "4", "--hdf5")
    for side in ("left", "right"):
        status, _, err = run("reach", "--urdf", str(BAXTER), "--base", "base", "--tip", side + "_gripper", *volume,
                             "--out", str(tmp_path / side))
        assert status == 0, err
    left, right = (ReachMap.read(tmp_path / side).share for side in ("left", "right"))
    np.testing.assert_allclose(left, right[:, ::-1], atol=0.26)  # they mirror each other
    status, out, err = run("reach_overlap", str(tmp_path / "left"), str(tmp_path / "right"), "--out",
                           str(tmp_path / "both"))
    assert status == 0, err
    assert "are reached by both" in out
    assert cv2.imread(str(tmp_path / "both" / "overlap.png")) is not None
    np.testing.assert_array_equal(np.load(tmp_path / "both" / "overlap.npz")["share"], np.minimum(left, right))
    status, out, err = run("reach_place", str(tmp_path / "left"), "--urdf", str(BAXTER), "--table", "0.2", "0.2",
                           "--region", "0.2", "1", "-0.6", "0.6", "-0.1", "0.1", "--step", "0.1")
    assert status == 0, err
    words = out.splitlines()[-1].split()
    assert words[:4] == ["at", "the", "first", "place"] and words[4] == words[6] and int(words[6]) > 20


def test_missing_meshes_are_told(tmp_path):
    """They are replaced by boxes, with which a map of postures without contact is another."""
    urdf = tmp_path / "arm.urdf"
    mesh = '<collision><geometry><mesh filename="package://no_such_package/part.stl"/></geometry></collision>'
    urdf.write_text('''<robot name="arm"><link name="foot"/><link name="tip">%s</link><joint name="j" type="revolute">
        <parent link="foot"/><child link="tip"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
        </joint></robot>''' % mesh)
    status, _, err = run("reach", "--urdf", str(urdf), "--tip", "tip", "--volume", "0", "1", "0", "1", "0", "1",
                         "--cell", "1", "--orientations", "1", "--self-collision", "--out", str(tmp_path / "map"))
    assert status == 0, err
    assert "no_such_package/part.stl cannot be found" in err
    urdf.write_text(urdf.read_text().replace(mesh, ""))
    status, _, err = run("reach", "--urdf", str(urdf), "--tip", "tip", "--self-collision", "--out",
                         str(tmp_path / "m2"))
    assert (status, err) == (1, "reach: no link of robot 'arm' has a <collision> shape; leave --self-collision out\n")
