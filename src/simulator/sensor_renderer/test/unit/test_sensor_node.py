# SPDX-License-Identifier: BSD-3-Clause
"""The loop of /sensor_renderer: which states of the world a sensor gets."""
import os
import threading
import types

import numpy as np
import pytest

from bullet_sim import MeshCache
from lab_testing.waiting import wait_until
from sensor_renderer import node
from sensor_renderer.node import SensorRenderer, leave_anyway
from sim_time.pace import Pace
from world_picture.snapshot import SnapshotReader, SnapshotWriter

STAND = """<robot name="stand"><link name="eye"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
</robot>"""
AT_ORIGIN = np.array([0.0, 0, 0, 0, 0, 0, 1])


class Eye:
    """A driver that records calls instead of drawing."""

    has_listeners = True
    memory_s = 0.0

    def __init__(self, entry):
        self.entry, self.pace, self.taken = entry, Pace(10.0), []
        Eye.made = self

    def time_was_reset(self):
        self.pace.restart()

    def is_due(self, time_s):
        return self.pace.is_due(time_s)

    def take(self, moment):
        self.pace.took(moment.time_s)
        self.taken.append(moment.time_s)

    def close(self):
        pass


def with_sensor(urdf):
    return {"name": "stand", "urdf": urdf, "joints": [], "sensors": [{
        "link": "eye", "frame": "eye", "offset": np.eye(4).ravel().tolist(), "plugin": 0, "namespace": "/ns",
        "xml": '<sensor type="camera" name="eye"><plugin name="p" filename="libeye.so"/></sensor>'}]}


@pytest.fixture
def simulator(tmp_path):
    writer = SnapshotWriter(tmp_path)
    writer.write_scene([with_sensor(STAND)])
    yield writer
    writer.close()


def test_the_same_time_after_a_reset_is_another_world(simulator, monkeypatch):
    """Lock-step: advance, look, reset, advance as far, look. The renderer may miss the state in between."""
    monkeypatch.setattr("importlib.import_module", lambda name: types.SimpleNamespace(Eye=Eye))
    renderer = SensorRenderer(lambda: None, {"libeye.so": "eyes:Eye"})
    reader = SnapshotReader(simulator.folder)
    for _ in range(3):
        simulator.write(25, 0.05, [AT_ORIGIN])
        for _ in range(5):
            renderer._turn(reader)
        simulator.resets += 1
    assert Eye.made.taken == [0.05] * 3


def test_a_mesh_of_a_package_that_came_later_is_drawn(simulator, tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.import_module", lambda name: types.SimpleNamespace(Eye=Eye))
    monkeypatch.setenv("ROS_PACKAGE_PATH", "%s:%s" % (tmp_path, os.environ["ROS_PACKAGE_PATH"]))
    renderer, reader = SensorRenderer(lambda: None, {"libeye.so": "eyes:Eye"}), SnapshotReader(simulator.folder)

    def corners(urdf):
        simulator.write_scene([with_sensor(urdf)])
        simulator.write(1, 0.0, [AT_ORIGIN])
        renderer._turn(reader)
        renderer._mirror._drawings.wait(60.0)
        renderer._turn(reader)
        return sum(len(part.triangles) for parts in renderer._mirror.bodies["stand"].parts for part in parts)

    box = STAND.split("<geometry>")[1].split("</geometry>")[0]
    assert corners(STAND.replace(box, '<mesh filename="package://made_later/part.obj"/>')) == 0
    (tmp_path / "made_later").mkdir()
    (tmp_path / "made_later" / "package.xml").write_text("<package><name>made_later</name></package>")
    (tmp_path / "made_later" / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert corners(STAND.replace(box, '<mesh filename="package://made_later/part.obj" scale="2 2 2"/>')) == 3


def test_cameras_that_wait_for_meshes_say_so(simulator, monkeypatch):
    monkeypatch.setattr("importlib.import_module", lambda name: types.SimpleNamespace(Eye=Eye))
    said, texts = threading.Event(), []
    monkeypatch.setattr(node.rospy, "loginfo", lambda text: (texts.append(text), said.set()))
    renderer = SensorRenderer(lambda: None, {"libeye.so": "eyes:Eye"})
    monkeypatch.setattr(renderer._mirror, "set_scene", lambda *_: said.wait(30.0))
    monkeypatch.setattr(node, "READS_WITHIN_S", 0.0)
    simulator.write(1, 0.0, [AT_ORIGIN])
    renderer._turn(SnapshotReader(simulator.folder))
    assert len(texts) == 1 and "cameras wait while meshes" in texts[0]
    monkeypatch.setattr(node, "READS_WITHIN_S", 1000.0)
    monkeypatch.setattr(renderer._mirror, "set_scene", lambda *_: None)
    simulator.write_scene([with_sensor(STAND)])
    simulator.write(2, 0.1, [AT_ORIGIN])
    renderer._turn(SnapshotReader(simulator.folder))
    assert len(texts) == 1


def test_cameras_go_on_while_a_mesh_is_simplified(simulator, tmp_path, monkeypatch):
    go_on, texts = threading.Event(), []

    class Process:
        """Simplifies the mesh when the test says so."""

        def call(self, function, *arguments):
            assert go_on.wait(30.0)
            return function(*arguments)

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("world_picture.background.LimitedProcess", lambda **limits: Process())
    monkeypatch.setattr("world_picture.background.LARGE_BYTES", 0)
    monkeypatch.setattr("importlib.import_module", lambda name: types.SimpleNamespace(Eye=Eye))
    monkeypatch.setattr(node.rospy, "loginfo", texts.append)
    renderer, reader = SensorRenderer(lambda: None, {"libeye.so": "eyes:Eye"}), SnapshotReader(simulator.folder)
    mesh = tmp_path / "part.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n", encoding="ascii")
    box = STAND.split("<geometry>")[1].split("</geometry>")[0]
    large = STAND.replace(box, '<mesh filename="file://%s"/>' % mesh).replace(
        "</link>", '<collision><geometry><box size="1 1 1"/></geometry></collision><collision><geometry>%s</geometry>'
        '</collision></link>' % ('<mesh filename="file://%s"/>' % mesh))
    assert MeshCache().corners(mesh) is None
    MeshCache().wavefront(str(mesh))  # as the simulator does for the collision
    simulator.write_scene([with_sensor(STAND), {"name": "large", "urdf": large, "joints": []}])
    place = np.array([3.0, 0, 0, 0, 0, 0, 1])

    def turn(number):
        simulator.write(number, 0.2 * number, [AT_ORIGIN, place])
        renderer._turn(reader)
        renderer._world.show(0.2 * number)
        body = renderer._mirror.bodies["large"]
        assert body.link_matrix("eye")[0, 3] == 3.0
        return [len(part.triangles) // 3 for part in body.parts[0]]

    try:
        assert turn(1) == [12, 4]
        assert len(texts) == 1 and "large" in texts[0] and "stand" not in texts[0]
        renderer._left_told_at -= node.LEFT_TOLD_S
        assert turn(2) == [12, 4] and Eye.made.taken == [0.2, 0.4]
        assert len(texts) == 2 and "large" in texts[1]
    finally:
        go_on.set()
    renderer._mirror._drawings.wait(30.0)
    assert turn(3) == [4] and len(Eye.made.taken) == 3 and not renderer._mirror.waiting
    assert len(texts) == 2


def test_topics_are_there_before_meshes_are_read(simulator, monkeypatch):
    monkeypatch.setattr("importlib.import_module", lambda name: types.SimpleNamespace(Eye=Eye))
    renderer, there = SensorRenderer(lambda: None, {"libeye.so": "eyes:Eye"}), []
    monkeypatch.setattr(renderer._mirror, "set_scene", lambda *_: there.extend(renderer._sensors))
    simulator.write(1, 0.0, [AT_ORIGIN])
    renderer._turn(SnapshotReader(simulator.folder))
    assert len(there) == 1


def test_a_sensor_that_fails_restarts_and_is_left_out_at_the_third_time_until_a_reset(simulator, monkeypatch):
    made, failing = [], [True] * 4

    class Weak(Eye):
        def __init__(self, entry):
            super().__init__(entry)
            made.append(self)

        def take(self, moment):
            super().take(moment)
            if failing and failing.pop():
                raise RuntimeError("broken on purpose")

    monkeypatch.setattr("importlib.import_module", lambda name: types.SimpleNamespace(Eye=Weak))
    renderer, reader = SensorRenderer(lambda: None, {"libeye.so": "eyes:Eye"}), SnapshotReader(simulator.folder)

    def go_on(ticks):
        for tick in ticks:
            simulator.write(tick, 0.002 * tick, [AT_ORIGIN])
            for _ in range(3):
                renderer._turn(reader)

    go_on([100, 200])
    assert len(made) == 3 and renderer._sensors, "made again twice"
    go_on([300, 400, 500])
    assert len(made) == 3 and not renderer._sensors and len(failing) == 1, "left out"
    simulator.resets += 1
    go_on([10, 110])
    assert len(made) == 5 and renderer._sensors and not failing, "made for the reset, failed once, made again"
    go_on([210])
    assert made[-1].taken


def test_a_node_that_makes_shapes_leaves_when_it_is_asked_to():
    ending, left = threading.Event(), threading.Event()
    leave_anyway(ending, 0.0, left.set)
    assert not left.wait(0.1)
    ending.set()
    wait_until(left.is_set, "the end")
