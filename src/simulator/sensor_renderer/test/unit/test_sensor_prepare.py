# SPDX-License-Identifier: BSD-3-Clause
"""Robots that are made ready for pictures."""
import os
import subprocess
import sys

import numpy as np
import pytest

from lab_testing.meshes import sphere
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from sensor_renderer.sides import Sides
from urdf_model.transforms import pose_matrix
from world_picture.drawing import DrawingCache

URDF = """<robot name="ball">
<link name="link"><visual><geometry><mesh filename="%s"/></geometry></visual></link></robot>"""
XACRO = """<robot name="ball" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="mesh" value="%s"/>
<link name="link"><visual><geometry><mesh filename="${mesh}"/></geometry></visual></link></robot>"""


@pytest.fixture
def robot(tmp_path):
    import trimesh

    vertices, faces = sphere(24)
    trimesh.Trimesh(0.3 * vertices, faces).export(str(tmp_path / "ball.stl"))
    path = tmp_path / "ball.urdf.xacro"
    path.write_text(XACRO % (tmp_path / "ball.stl"))
    return path


def prepare(cache, *paths):
    return subprocess.run([sys.executable, "-m", "sensor_renderer.prepare", *map(str, paths)], capture_output=True,
                          text=True, env={**os.environ, "XDG_CACHE_HOME": str(cache)}, timeout=300)


def test_a_prepared_robot_is_drawn_without_delay(tmp_path, monkeypatch, robot):
    done = prepare(tmp_path / "cache", robot)
    assert (done.returncode, done.stderr) == (0, "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    renderer = GlRenderer()
    for name in ("from_behind", "plainly_from_behind"):
        monkeypatch.setattr(Sides, name, lambda *_: pytest.fail("looked for backs"))
    monkeypatch.setattr("world_picture.drawing._PROCESS", None)
    mirror = Mirror(DrawingCache(), lambda uri: uri, pytest.fail)
    mirror.set_scene([{"name": "ball", "urdf": URDF % (tmp_path / "ball.stl"), "joints": []}])
    mirror.set_state(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    for distance in (0.5, 2.0, 10.0):
        pinhole = Pinhole.from_field_of_view(64, 64, 1.0, 0.05, 20.0)
        renderer.render(mirror, pinhole, pose_matrix((-distance, 0.0, 0.0), (0.0, 0.0, 0.0)) @ OPTICAL)
    renderer.close()


def test_what_is_no_robot_is_named_and_the_others_are_prepared(tmp_path, robot):
    bad, worse = tmp_path / "bad.urdf", tmp_path / "worse.xacro"
    bad.write_text("<robot")
    worse.write_text("<robot xmlns:xacro='http://www.ros.org/wiki/xacro'>${1/0}</robot>")
    done = prepare(tmp_path / "cache", bad, worse, tmp_path / "none.urdf", robot)
    assert done.returncode == 1
    assert [line.split(": ")[:2] for line in done.stderr.splitlines() if line.startswith("sensor_renderer")] == [
        ["sensor_renderer.prepare", str(path)] for path in (bad, worse, tmp_path / "none.urdf")]
    assert list((tmp_path / "cache" / "bullet_gazebo" / "drawings").iterdir())


def test_a_mesh_that_is_missing_does_not_stop_it(tmp_path, robot):
    (tmp_path / "ball.stl").unlink()
    done = prepare(tmp_path / "cache", robot)
    assert done.returncode == 0
