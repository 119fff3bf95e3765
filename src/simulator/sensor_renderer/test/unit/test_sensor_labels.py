# SPDX-License-Identifier: BSD-3-Clause
"""Masks and optical flow: what a pixel shows, and where that was before."""
import json

import numpy as np
import pytest

from sensor_renderer import topics
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.labels import Labels, OpticalFlow, classes_of_parameter
from sensor_renderer.lens import Distortion, Lens
from sensor_renderer.mirror import Mirror
from sensor_renderer.moments import DrawnMoments, Moment
from sensor_renderer.pinhole import OPTICAL, Pinhole
from sensor_renderer.sensor_element import CameraElement
from sensor_renderer.tiny_renderer import TinyRenderer
from world_picture.drawing import DrawingCache

PINHOLE = Pinhole.from_field_of_view(320, 240, 1.0, 0.05, 20.0)
BARREL = Distortion(-0.25, 0.08, 0.001, -0.001, 0.0)
EYE = """<robot name="eye"><link name="eye"/></robot>"""
CUBE = """<robot name="cube"><link name="l"><visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual></link>
</robot>"""
ORIGIN = [0, 0, 0, 0, 0, 0, 1.0]


@pytest.fixture(params=[GlRenderer, TinyRenderer])
def renderer(request):
    made = request.param()
    yield made
    made.close()


def scene(renderer, tmp_path, cubes, labels=None):
    """A DrawnMoments of a camera at the origin that looks along x, and cubes {name: y [m]}, their faces 1 m away."""
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([{"name": name, "urdf": EYE if name == "eye" else CUBE, "joints": []} for name in ("eye", *cubes)])
    world = DrawnMoments(mirror, lambda: renderer, labels)
    world.remember(0.0, state(cubes.values()))
    return world


def state(places, eye=ORIGIN):
    return np.array([*eye, *(value for y in places for value in (1.1, y, 0, 0, 0, 0, 1.0))])


def camera(distortion=None):
    lens = Lens(PINHOLE, distortion) if distortion else None
    return CameraElement("eye", PINHOLE, OPTICAL, "rgb8", 0.0, distortion or Distortion(), lens)


def test_masks_show_models_and_their_classes(renderer, tmp_path):
    world = scene(renderer, tmp_path, {"block_1": 0.3, "block_2": -0.3, "cup": 0.0})
    moment = Moment(world, "eye", "eye", 0.0)
    labels = moment.labels
    numbers, links, depth = camera().identified(moment)
    classes, models = labels.masks(numbers, links)
    named = {name: number for number, name in labels.models.items()}
    kinds = {name: number for number, name in labels.classes.items()}
    assert set(named) == {"nothing", "eye", "block_1", "block_2", "cup"}
    assert set(kinds) == {"nothing", "eye", "block", "cup"}
    for name, y in (("block_1", 0.3), ("block_2", -0.3), ("cup", 0.0)):
        (column, row), = PINHOLE.project([[-y, 0.0, 1.0]]).round().astype(int)
        assert models[row, column] == named[name] and depth[row, column] == pytest.approx(1.0, abs=1e-3)
        assert classes[row, column] == kinds[name.split("_")[0]]
        # From edge to edge of its face.
        columns = np.nonzero(models[row] == named[name])[0]
        assert len(columns) >= 0.2 * PINHOLE.fx - 2
    assert models[5, 5] == 0 and classes[5, 5] == 0 and np.isnan(depth[5, 5])


def test_numbers_stay_when_models_go():
    labels = Labels()
    labels.cover(["a", "b_1"])
    labels.cover(["b_1", "c"])
    assert labels.models == {0: "nothing", 1: "a", 2: "b_1", 3: "c"}
    assert labels.classes == {0: "nothing", 1: "a", 2: "b", 3: "c"}


def test_classes_of_a_parameter_come_first():
    labels = Labels(classes_of_parameter([{"class": "tool", "models": ["hammer*", "saw"]},
                                          {"class": "robot", "models": ["baxter"]}]))
    labels.cover(["table_2", "baxter", "hammer_7", "saw"])
    assert labels.classes == {0: "nothing", 1: "tool", 2: "robot", 3: "table"}
    masks = labels.masks(np.array([[0, 1, 2, 3]]), [("hammer_7", 0), ("baxter", 4), ("table_2", 0)])
    assert masks[0].tolist() == [[0, 1, 2, 3]] and masks[1].tolist() == [[0, 3, 2, 1]]


@pytest.mark.parametrize("value", ["robot", [{"class": "a"}], [{"class": "a", "models": "b"}], [3]])
def test_classes_that_are_of_no_use_are_refused(value):
    with pytest.raises(ValueError, match="expected a list of {class: NAME, models: "):
        classes_of_parameter(value)


@pytest.mark.parametrize("distortion", [None, BARREL])
def test_flow_says_where_each_point_was(tmp_path, distortion):
    """A cube goes to the left, and the camera goes back: by projecting points, without pictures."""
    renderer = GlRenderer()
    world, eye = scene(renderer, tmp_path, {"cube": 0.1, "wall": -0.25}), camera(distortion)
    motion = OpticalFlow()

    def flow(time_s):
        moment = Moment(world, "eye", "eye", time_s)
        numbers, links, depth = eye.identified(moment)
        return motion.flow(eye, moment, numbers, links, depth), Labels().masks(numbers, links)[1]

    assert np.isnan(flow(0.0)[0]).all(), "the first picture has none before it"
    world.remember(0.1, state((0.14, -0.25), eye=[-0.05, 0, 0, 0, 0, 0, 1.0]))
    found, models = flow(0.1)
    for y_before, y_now in ((0.1, 0.14), (-0.25, -0.25)):
        # A point of the face: 1 m away before, 1.05 m now.
        before, = eye.project(np.array([[-y_before + 0.03, 0.04, 1.0]]))
        now, = eye.project(np.array([[-y_now + 0.03, 0.04, 1.05]]))
        column, row = now.round().astype(int)
        assert found[row, column] == pytest.approx(now - before, abs=0.15)
        assert np.linalg.norm(now - before) > 1.0
    assert np.isnan(found[models == 0]).all() and np.isfinite(found[models > 0]).all()
    renderer.close()


def test_flow_takes_one_picture_to_the_next(tmp_path):
    """The robot's own programs would do so: the last picture, taken at p - flow, is this picture."""
    import cv2

    renderer = GlRenderer()
    world, eye, motion = scene(renderer, tmp_path, {"cube": 0.1, "wall": -0.25}), camera(), OpticalFlow()
    pictures = []
    for time_s, places, x in ((0.0, (0.1, -0.25), 0.0), (0.1, (0.13, -0.25), -0.03)):
        world.remember(time_s, state(places, eye=[x, 0, 0, 0, 0, 0, 1.0]))
        moment = Moment(world, "eye", "eye", time_s)
        flow = motion.flow(eye, moment, *eye.identified(moment))
        pictures.append(eye.view(moment, True, False)[0])
    columns, rows = np.meshgrid(np.arange(320, dtype=np.float32), np.arange(240, dtype=np.float32))
    known = np.isfinite(flow[..., 0])
    moved = cv2.remap(pictures[0], np.nan_to_num(columns - flow[..., 0]), np.nan_to_num(rows - flow[..., 1]),
                      cv2.INTER_LINEAR)
    off = np.abs(moved[known].astype(int) - pictures[1][known]).max(axis=1)
    assert (off < 12).mean() > 0.97
    renderer.close()


class Heard:
    """A topic with or without subscribers."""

    def __init__(self, name, message_class, latch=False):
        self.name, self.latch, self.sent, self.has_listeners = name, latch, [], name in Heard.wanted

    def publish(self, message):
        self.sent.append(message)

    def close(self):
        pass


@pytest.mark.parametrize("turned", [(1, 1), (-1, -1)])
def test_topics_for_learning(tmp_path, monkeypatch, turned):
    renderer = GlRenderer()
    world = scene(renderer, tmp_path, {"block_1": 0.3})
    monkeypatch.setattr(topics, "WatchedTopic", Heard)
    Heard.wanted = {"/eye/semantic/image_raw", "/eye/instance/labels", "/eye/flow/image_raw",
                    "/eye/ideal_depth/image_raw"}
    learning = topics.LearningTopics("/eye")
    learning.open(True)
    for time_s, y in ((0.0, 0.3), (0.1, 0.32)):
        world.remember(time_s, state([y]))
        learning.publish(Moment(world, "eye", "eye", time_s), camera(), "frame", turned)
    sent = {name: topic.sent for name, topic in learning._topics.items()}
    assert {name: len(messages) for name, messages in sent.items()} == {
        "semantic/image_raw": 2, "instance/image_raw": 0, "ideal_depth/image_raw": 2, "flow/image_raw": 2,
        "semantic/labels": 1, "instance/labels": 1}
    assert json.loads(sent["semantic/labels"][0].data) == {"0": "nothing", "1": "eye", "2": "block"}
    (column, row), = PINHOLE.project([[-0.32, 0.0, 1.0]]).round().astype(int)
    row, column = (row, column) if turned[0] > 0 else (239 - row, 319 - column)
    mask, depth, flow = (sent[name + "/image_raw"][1] for name in ("semantic", "ideal_depth", "flow"))
    assert (mask.encoding, depth.encoding, flow.encoding) == ("mono8", "32FC1", "32FC2")
    assert mask.header.frame_id == "frame" and flow.header.stamp.to_sec() == pytest.approx(0.1)
    assert np.frombuffer(mask.data, np.uint8).reshape(240, 320)[row, column] == 2
    assert np.frombuffer(depth.data, np.float32).reshape(240, 320)[row, column] == pytest.approx(1.0, abs=1e-3)
    moved = np.frombuffer(flow.data, np.float32).reshape(240, 320, 2)[row, column]
    assert moved == pytest.approx([-turned[1] * 0.02 * PINHOLE.fx, 0.0], abs=0.1)
    renderer.close()


def test_without_subscribers_nothing_is_drawn(monkeypatch):
    monkeypatch.setattr(topics, "WatchedTopic", Heard)
    Heard.wanted = set()
    learning = topics.LearningTopics("/eye")
    learning.open(True)
    assert not learning.has_listeners
    learning.publish(None, None, "frame")
