# SPDX-License-Identifier: BSD-3-Clause
"""The world for a browser, from a snapshot that the test writes."""
import json
from types import SimpleNamespace

import numpy as np
import pytest

from lab_web.scene import SceneFollower, picture_of
from sensor_renderer.mirror import DetailLevel, DrawnPart
from world_picture.snapshot import SnapshotError, SnapshotWriter

BOX = """<robot name="box"><link name="box"><visual><geometry><box size="0.2 0.2 0.2"/></geometry>
<material name="red"><color rgba="1 0 0 1"/></material></visual></link></robot>"""


@pytest.fixture
def writer(tmp_path):
    made = SnapshotWriter(tmp_path)
    yield made
    made.close()


def body(name, urdf=BOX):
    return {"name": name, "urdf": urdf, "joints": []}


def pose(x):
    return [x, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]


def test_shapes_come_once_and_poses_follow_the_bodies(writer):
    writer.write_scene([body("floor", None), body("a"), body("b")])
    follower = SceneFollower(writer.folder, pytest.fail)
    writer.write(1, 0.0, [np.array(pose(0.0) + pose(1.0) + pose(2.0))])
    assert follower.follow() and not follower.follow()
    scene = json.loads(follower.picture.text)
    assert [entry["name"] for entry in scene["bodies"]] == ["floor", "a", "b"]
    parts = [entry["links"] for entry in scene["bodies"]]
    assert parts[0] == [[]] and parts[1] == parts[2] == [[{"shape": parts[1][0][0]["shape"], "colour": [1, 0, 0, 1]}]]
    (content,) = follower.picture.shapes.values()
    rows = np.frombuffer(content, "<f4").reshape(-1, 6)
    assert len(rows) == 36 and np.allclose(np.abs(rows[:, :3]), 0.1)
    assert np.allclose(np.linalg.norm(rows[:, 3:], axis=1), 1.0)
    poses = follower.poses()
    assert np.frombuffer(poses[:4], "<u4") == scene["revision"]
    matrices = np.frombuffer(poses[4:], "<f4").reshape(3, 3, 4)
    assert np.allclose(matrices[:, :, 3], [[0, 0, 0.5], [1, 0, 0.5], [2, 0, 0.5]])
    writer.write(2, 0.1, [np.array(pose(0.0) + pose(1.0) + pose(5.0))])
    assert follower.follow()
    assert np.frombuffer(follower.poses()[4:], "<f4").reshape(3, 3, 4)[2, 0, 3] == 5.0


def test_a_body_that_trembles_is_at_rest_and_a_slow_one_is_not(writer):
    writer.write_scene([body("a")])
    follower, told, x = SceneFollower(writer.folder, pytest.fail), [], 0.0
    for tick in range(1, 41):
        # Twenty ticks of trembling, then 50 um in each.
        x = 2e-5 * (-1) ** tick if tick <= 20 else x + 5e-5
        writer.write(tick, 0.05 * tick, [np.array(pose(x))])
        if follower.follow():
            told.append((tick, np.frombuffer(follower.poses()[4:], "<f4")[3]))
    assert told[0][0] == 1 and all(tick > 20 for tick, _ in told[1:])
    assert 5 <= len(told) <= 12 and told[-1][1] == pytest.approx(x, abs=1.5e-4)


def test_a_new_body_makes_a_new_picture(writer):
    writer.write_scene([body("a")])
    writer.write(1, 0.0, [np.array(pose(0.0))])
    follower = SceneFollower(writer.folder, pytest.fail)
    follower.follow()
    first = follower.picture
    writer.write_scene([body("a"), body("b", BOX.replace("0.2 0.2 0.2", "0.4 0.2 0.2"))])
    writer.write(2, 0.1, [np.array(pose(0.0) + pose(1.0))])
    assert follower.follow() and follower.picture.revision > first.revision and len(follower.picture.shapes) == 2


def test_parts_have_the_coarsest_triangles_that_are_near_the_original():
    plain, near, finest = (np.full((3 * count, 6), count, np.float32) for count in (1, 4, 9))
    levels = tuple(DetailLevel(error_m, lambda rows=rows: rows, lambda rows=rows: np.zeros((len(rows), 2)))
                   for error_m, rows in ((0.001, finest), (0.0025, near), (0.01, plain)))
    part = DrawnPart("shape", plain, (1.0, 0.0, 0.0, 1.0), levels=levels)
    body = SimpleNamespace(parts=[[part, DrawnPart("box", plain, (1.0, 0.0, 0.0, 1.0))]], joint_names=[],
                           link_names=["a"])
    light = SimpleNamespace(ambient=[0.5], to_sun=[0.0, 0.0, 1.0], sun=[0.5])
    picture = picture_of(SimpleNamespace(bodies={"a": body}, light=light), 1)
    (first, second), = json.loads(picture.text)["bodies"][0]["links"]
    assert len(picture.shapes[first["shape"]]) == near.nbytes
    assert len(picture.shapes[second["shape"]]) == plain.nbytes


def test_without_a_simulator_there_is_no_scene(tmp_path):
    with pytest.raises(SnapshotError):
        SceneFollower(tmp_path / "none", pytest.fail)
