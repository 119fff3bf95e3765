# SPDX-License-Identifier: BSD-3-Clause
"""Files that descriptions name, also those that come while the simulator runs."""
import os

import pytest
import rospkg

from gazebo_ros.resources import ResourceFinder

MESH = "package://made_later/meshes/part.stl"


@pytest.fixture
def make_package(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_PACKAGE_PATH", "%s:%s" % (tmp_path, os.environ["ROS_PACKAGE_PATH"]))

    def make():
        mesh = tmp_path / "made_later" / "meshes" / "part.stl"
        mesh.parent.mkdir(parents=True)
        mesh.touch()
        (tmp_path / "made_later" / "package.xml").write_text("<package><name>made_later</name></package>")
        return str(mesh)

    return make


def test_a_package_that_is_made_later_is_found_when_looked_for_again(make_package):
    finder = ResourceFinder()
    assert finder(MESH) is None
    mesh = make_package()
    assert finder(MESH) is None
    finder.forget_missing()
    assert finder(MESH) == mesh
    assert finder("package://gazebo_ros/package.xml") is not None


def test_all_folders_are_walked_through_once_for_all_that_is_missing(monkeypatch):
    made, new = [], rospkg.RosPack
    monkeypatch.setattr(rospkg, "RosPack", lambda: made.append(new()) or made[-1])
    finder = ResourceFinder()
    assert [finder("package://nowhere_%d/part.stl" % k) for k in range(20)] == [None] * 20
    assert len(made) == 2  # the first one and another look


def test_files_are_found_by_every_kind_of_name(tmp_path, monkeypatch):
    (tmp_path / "models" / "mug").mkdir(parents=True)
    mesh = tmp_path / "models" / "mug" / "the mug.stl"
    mesh.touch()
    monkeypatch.setenv("GAZEBO_MODEL_PATH", str(tmp_path / "models"))
    finder = ResourceFinder()
    assert finder("model://mug/the%20mug.stl") == str(mesh)
    assert finder("file://" + str(mesh).replace(" ", "%20")) == str(mesh)
    assert finder(str(mesh)) == str(mesh)
    assert finder("model://mug/other.stl") is None
    assert finder("http://mug/the mug.stl") is None
