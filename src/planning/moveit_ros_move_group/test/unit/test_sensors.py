# SPDX-License-Identifier: BSD-3-Clause
"""A camera's clouds become the scene's octomap, in messages that octomap itself can read."""
import errno
import functools
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import fcl
import numpy as np
import pytest
import rospy
from moveit_msgs.srv import LoadMapRequest, SaveMapRequest
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2, PointField
from std_msgs.msg import Header

from lab_testing.waiting import wait_until
from motion_planning.occupancy import OccupancyMap
from motion_planning.shapes import Octree
from moveit_ros_move_group.convert.clouds import cloud_of, points_of, points_of_depth
from moveit_ros_move_group.convert.geometry import MessageError
from moveit_ros_move_group.convert.octomap import octomap_message, octree_of
from moveit_ros_move_group.convert.octomap_file import file_of, octree_of_file
from moveit_ros_move_group.sensors import read_settings

sys.path.insert(0, str(Path(__file__).parents[1]))
from in_process import Node  # noqa: E402

# As long as a slow machine may need: what is tested is the answer.
PATIENCE_S = 60.0
wait_for = functools.partial(wait_until, timeout_s=PATIENCE_S)
CLOUD = {"sensor_plugin": "occupancy_map_monitor/PointCloudOctomapUpdater", "point_cloud_topic": "/eye/points",
         "max_range": 3.0, "padding_offset": 0.02, "filtered_cloud_topic": "filtered_cloud"}
# A box of 0.1 m on a post that nothing stands for.
URDF = """<robot name="post"><link name="base"/><link name="arm"><collision><geometry>
  <box size="0.1 0.1 0.4"/></geometry></collision></link>
  <joint name="turn" type="revolute"><origin xyz="0 0 0.5"/><parent link="base"/><child link="arm"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""
SRDF = """<robot name="post"><virtual_joint name="world_joint" type="fixed" parent_frame="world" child_link="base"/>
  <group name="arm"><joint name="turn"/></group></robot>"""


def cloud(points, frame="base", stamp=10.0):
    return cloud_of(np.asarray(points, dtype=np.float32), Header(stamp=rospy.Time.from_sec(stamp), frame_id=frame))


# -- messages -------------------------------------------------------------------------------------------------------

def test_clouds_of_any_layout_are_read():
    points = np.arange(18, dtype=np.float32).reshape(6, 3)
    assert (points_of(cloud(points)) == points).all()
    rows = np.zeros((2, 3), np.dtype({"names": ["x", "y", "z"], "formats": [">f4"] * 3, "offsets": [4, 12, 8],
                                      "itemsize": 20}))
    for i, name in enumerate("xyz"):
        rows[name] = points[:, i].reshape(2, 3)
    data = b"".join(row.tobytes() + b"gap" for row in rows)
    message = PointCloud2(height=2, width=3, point_step=20, row_step=63, is_bigendian=True, data=data, fields=[
        PointField(name, offset, PointField.FLOAT32, 1) for name, offset in (("x", 4), ("y", 12), ("z", 8))])
    assert (points_of(message) == points).all()
    message.row_step = 200
    with pytest.raises(MessageError, match="sizes do not fit"):
        points_of(message)
    message.fields.pop()
    with pytest.raises(MessageError, match="no field 'z'"):
        points_of(message)


@pytest.mark.parametrize(("encoding", "kind", "unit"), [("32FC1", "<f4", 1.0), ("16UC1", "<u2", 1e3)])
def test_depth_images_are_read(encoding, kind, unit):
    depth = np.array([[1.0, 2.0, 0.1], [0.0, 9.0, 3.0]])
    image = Image(height=2, width=3, encoding=encoding, data=(depth * unit).astype(kind).tobytes(),
                  step=3 * np.dtype(kind).itemsize)
    info = CameraInfo(K=[2.0, 0.0, 1.0, 0.0, 4.0, 0.5, 0.0, 0.0, 1.0])
    points = points_of_depth(image, info, 0.3, 5.0)
    expected = [(-0.5, -0.125, 1.0), (0.0, -0.25, 2.0), None, None, None, (1.5, 0.375, 3.0)]
    for point, wanted in zip(points, expected, strict=True):
        assert np.isnan(point[2]) if wanted is None else point == pytest.approx(wanted)
    image.encoding = "rgb8"
    with pytest.raises(MessageError, match="rgb8"):
        points_of_depth(image, info, 0.3, 5.0)


def test_octomap_messages_are_what_octomap_reads():
    boxes = np.array([(0.05, 0.05, 0.05, 0.1), (0.15, 0.05, 0.05, 0.1), (-0.95, 0.45, 2.05, 0.1),
                      (0.2, -0.2, 0.2, 0.4)])
    message = octomap_message(Octree(0.1, boxes), np.eye(4), "world", rospy.Time(5)).octomap
    assert (message.id, message.binary, message.resolution) == ("OcTree", True, 0.1)
    back = octree_of(message).boxes
    assert sorted(map(tuple, back.round(6).tolist())) == sorted(map(tuple, boxes.round(6).tolist()))
    # FCL hands the stream to octomap's own reader.
    tree = fcl.CollisionObject(fcl.OcTree(0.1, np.array(message.data, dtype=np.int8)))
    for centre, side in ((box[:3], box[3]) for box in boxes):
        for offset, hit in ((0.0, True), (0.5 * side + 0.02, False)):
            probe = fcl.CollisionObject(fcl.Sphere(0.01), fcl.Transform(centre + (0.0, 0.0, offset)))
            assert (fcl.collide(tree, probe) > 0) == hit


BOXES = np.array([(0.05, 0.05, 0.05, 0.1), (-0.95, 0.45, 2.05, 0.1), (0.2, -0.2, 0.2, 0.4)])


def test_octomaps_files_are_written_and_read():
    content = file_of(Octree(0.1, BOXES), 0.1)
    head, _, data = content.partition(b"\ndata\n")
    lines = head.decode().splitlines()
    assert lines[0] == "# Octomap OcTree binary file" and {"id OcTree", "res 0.1"} <= set(lines)
    assert data == np.array(octomap_message(Octree(0.1, BOXES), np.eye(4), "world", rospy.Time(5)).octomap.data,
                            dtype=np.int8).tobytes()
    # Three leaves, and the inner nodes above them, of two bytes each.
    assert "size %d" % (3 + len(data) // 2) in lines
    back = octree_of_file(content).boxes
    assert sorted(map(tuple, back.round(6).tolist())) == sorted(map(tuple, BOXES.round(6).tolist()))
    assert octree_of_file(file_of(None, 0.1)) is None


@pytest.mark.parametrize(("content", "reason"), [
    (b"", "does not begin"), (b"# Octomap OcTree binary file\nid OcTree\nres 0.1\n", "no line 'data'"),
    (b"# Octomap OcTree binary file\nid OcTree\nres far\ndata\n00", "no resolution: 'res far'"),
    (b"# Octomap OcTree binary file\nid OcTree\nres 0.1\ndata\n\xff", "end too early"),
    (b"# Octomap OcTree binary file\nid Quadtree\nres 0.1\ndata\n00", "expected an OcTree"),
])
def test_files_that_are_none_are_refused(content, reason):
    with pytest.raises(MessageError, match=reason):
        octree_of_file(content)


def test_settings_are_understood_and_nonsense_is_told():
    found, complaints = read_settings([CLOUD, {"sensor_plugin": "a/LaserUpdater"}, 7,
                                       {**CLOUD, "point_subsample": 3, "max_range": "far"}])
    assert len(found) == 2 and found[1].subsample == 3 and found[1].max_range == np.inf
    assert len(complaints) == 3 and any("LaserUpdater" in text for text in complaints)
    assert read_settings("none") == ([], [])


# -- the node -------------------------------------------------------------------------------------------------------

@pytest.fixture
def node(monkeypatch):
    parameters = {"robot_description": URDF, "robot_description_semantic": SRDF,
                  "~": {"sensors": [CLOUD], "octomap_resolution": 0.05, "octomap_frame": "base", "max_range": 2.0}}
    node = Node(monkeypatch, parameters)
    node.ask("joint_states", JointState(header=Header(stamp=rospy.Time(10)), name=["turn"], position=[0.0]))
    return node


@pytest.mark.parametrize(("kinds", "stays"), [
    (["PointCloudObstacles"], False), (["PointCloudObstacles", "PointCloudOctomapUpdater"], True)])
def test_a_cloud_alone_is_an_obstacle_until_the_next_one(monkeypatch, kinds, stays):
    sensors = [{**CLOUD, "sensor_plugin": "occupancy_map_monitor/" + kind} for kind in kinds]
    node = Node(monkeypatch, {"robot_description": URDF, "robot_description_semantic": SRDF, "~": {
        "sensors": sensors, "octomap_resolution": 0.05, "octomap_frame": "base", "max_range": 2.0}})
    node.ask("joint_states", JointState(header=Header(stamp=rospy.Time(10)), name=["turn"], position=[0.0]))
    node.ask("/eye/points", cloud([(1.0, 0.0, 0.5)]))
    wait_for(lambda: len(octomap_of(node)) == 1, lambda: "one cube; there are %d" % len(octomap_of(node)))
    # Another direction, so that no ray clears the first one.
    node.ask("/eye/points", cloud([(0.0, 1.0, 0.5)]))
    wait_for(lambda: (abs(octomap_of(node)[:, 1]) > 0.5).any(), "the second cube")
    assert (octomap_of(node)[:, 0] > 0.5).any() == stays
    assert any("only one map is kept" in line for line in node.logged) == stays
    message = node.context.monitor.octomap()
    assert len(octree_of(message.octomap).boxes) == 1 + stays


def octomap_of(node):
    octomap = node.context.monitor.scene().octomap
    return np.empty((0, 3)) if octomap is None else octomap.shapes[0][0].boxes[:, :3]


def test_a_cloud_becomes_an_obstacle_and_goes_again(node):
    node.ask("/eye/points", cloud([(1.0, 0.0, 0.5), (1.0, 0.3, 0.5), (2.5, 0.0, 0.5), (0.0, 0.0, 0.6)]))
    wait_for(lambda: len(octomap_of(node)), "octomap")
    # The point beyond the range and that on the robot's arm are not obstacles.
    assert sorted(map(tuple, octomap_of(node).round(3).tolist())) == [(1.025, 0.025, 0.525), (1.025, 0.325, 0.525)]
    shown = points_of(node.told("~display_octomap")[-1])
    assert len(shown) == 2
    scene = node.ask("get_planning_scene", SimpleNamespace(components=SimpleNamespace(components=0))).scene
    assert scene.world.octomap.header.frame_id == "base" and scene.world.octomap.octomap.id == "OcTree"
    node.ask("clear_octomap", None)
    assert not len(octomap_of(node))
    node.ask("/eye/points", cloud([(1.0, 0.3, 0.5)]))
    wait_for(lambda: len(octomap_of(node)), "octomap after it was cleared")
    assert len(octomap_of(node)) == 1


def test_the_arm_is_where_it_was_at_the_clouds_time(node):
    # The arm is a box of 0.1 m; turned by an eighth its edge is where the point is, which is beside its face before.
    for stamp, turn in ((20.0, 0.0), (21.0, 0.785), (22.0, 0.0)):
        state = JointState(header=Header(stamp=rospy.Time.from_sec(stamp)), name=["turn"], position=[turn])
        for topic in ("joint_states", "/joint_states"):  # the monitor's, and the sensors' own
            node.ask(topic, state)
    far = (1.0, 0.3, 0.5)
    node.ask("/eye/points", cloud([(0.0, 0.09, 0.6), far], stamp=21.0))
    wait_for(lambda: len(octomap_of(node)), "octomap")
    assert len(octomap_of(node)) == 1
    node.ask("/eye/points", cloud([(0.0, 0.09, 0.6), far], stamp=22.0))
    wait_for(lambda: len(octomap_of(node)) == 2, "point beside the arm")


def test_clouds_that_cannot_be_used_are_told_once_in_the_log(node):
    node.ask("/eye/points", PointCloud2(header=Header(frame_id="base")))
    wait_for(lambda: any("no field" in line for line in node.logged), "word of the cloud's fields")
    node.ask("/eye/points", cloud([(1.0, 0.3, 0.5)]))
    wait_for(lambda: len(octomap_of(node)), "octomap")


def test_an_octomap_is_saved_and_loaded(node, tmp_path):
    file = tmp_path / "seen.bt"
    node.ask("/eye/points", cloud([(1.0, 0.0, 0.5), (1.0, 0.3, 0.5)]))
    wait_for(lambda: len(octomap_of(node)) == 2, "octomap")
    seen = octomap_of(node)
    assert node.ask("~save_map", SaveMapRequest(str(file))).success
    node.ask("clear_octomap", None)
    assert node.ask("~load_map", LoadMapRequest(str(file))).success
    assert octomap_of(node).tolist() == seen.tolist()
    assert len(points_of(node.told("~display_octomap")[-1])) == 2
    # What is loaded is in the map of the sensors, too: the next cloud adds to it.
    node.ask("/eye/points", cloud([(1.0, 0.6, 0.5)]))
    wait_for(lambda: len(octomap_of(node)) == 3, "a third cell")


@pytest.mark.parametrize(("content", "reason"), [
    (None, os.strerror(errno.ENOENT)), (b"solid cube", "does not begin"),
    (file_of(Octree(0.1, BOXES), 0.1), "0.1 m wide")])
def test_a_map_that_cannot_be_loaded_changes_nothing(node, tmp_path, content, reason):
    file = tmp_path / "seen.bt"
    if content is not None:
        file.write_bytes(content)
    node.ask("/eye/points", cloud([(1.0, 0.3, 0.5)]))
    wait_for(lambda: len(octomap_of(node)) == 1, "octomap")
    assert not node.ask("~load_map", LoadMapRequest(str(file))).success
    assert len(octomap_of(node)) == 1
    assert any("load_map" in line and reason in line for line in node.logged), node.logged
    assert not node.ask("~save_map", SaveMapRequest(str(tmp_path / "nowhere" / "seen.bt"))).success


def test_large_cubes_fill_their_cells():
    cells = OccupancyMap(0.1)
    cells.take(Octree(0.1, BOXES))
    assert len(cells) == 2 + 4 ** 3
    found = cells.octree().boxes
    assert (found[:, 3] == 0.1).all()
    inside = np.abs(found[:, :3] - BOXES[2, :3]).max(axis=1) < 0.2
    assert inside.sum() == 4 ** 3
    cells.take(None)
    assert not len(cells)
    with pytest.raises(ValueError, match="cells"):
        cells.take(Octree(0.1, np.array([(204.8, 204.8, 204.8, 409.6)])))
