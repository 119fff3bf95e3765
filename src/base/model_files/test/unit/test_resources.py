# SPDX-License-Identifier: BSD-3-Clause
"""Files that descriptions name, also those that appear while the simulator runs."""
import os

import pytest
import rospkg

from model_files.resources import (
    ResourceFinder,
    exported_folders,
    model_folders,
    model_sizes,
    plugin_tables,
    resource_folders,
)
from sdf_model import ModelFolders, parse_sdf_model
from urdf_model import merge_fixed

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


@pytest.fixture
def exporting(tmp_path, monkeypatch):
    """A package that exports folders of models and media, as those made for Gazebo do; returns its folder."""
    folder = tmp_path / "field"
    for name in ("models/mug", "more", "media", "plugins"):
        (folder / name).mkdir(parents=True)
    (folder / "models" / "mug" / "mug.stl").touch()
    (folder / "media" / "part.stl").touch()
    (folder / "plugins" / "model_plugins.yaml").touch()
    (folder / "package.xml").write_text("""<package><name>field</name><export>
<gazebo_ros gazebo_model_path="${prefix}/models:${prefix}/more" gazebo_media_path="${prefix}"
            plugin_path="${prefix}/lib:${prefix}/plugins"/>
</export></package>""")
    monkeypatch.setenv("ROS_PACKAGE_PATH", "%s:%s" % (tmp_path, os.environ["ROS_PACKAGE_PATH"]))
    return folder


def test_packages_export_folders_of_models_and_media(exporting, monkeypatch):
    monkeypatch.setenv("GAZEBO_MODEL_PATH", "/first")
    assert exported_folders("gazebo_model_path") == [exporting / "models", exporting / "more"]
    assert str(model_folders()[0]) == "/first" and exporting / "models" in model_folders()
    assert exporting in resource_folders()
    finder = ResourceFinder()
    assert finder("model://mug/mug.stl") == str(exporting / "models" / "mug" / "mug.stl")
    assert finder("file://media/part.stl") == str(exporting / "media" / "part.stl")


def test_packages_export_tables_of_plugins(exporting, monkeypatch):
    monkeypatch.setenv("GAZEBO_PLUGIN_PATH", "/nowhere")
    assert plugin_tables() == [exporting / "plugins" / "model_plugins.yaml"]


def test_models_of_gazebos_library_have_stand_ins_of_their_size():
    packages = rospkg.RosPack()
    folders = ModelFolders([], model_sizes(packages))
    for name, size in model_sizes(packages).items():
        text = '<sdf version="1.6"><include><uri>model://%s</uri><name>it</name></include></sdf>' % name
        model = parse_sdf_model(text, "lab.world", folders)
        body, = merge_fixed(model.robot).links.values()
        assert model.static == ("mass" not in size), name
        assert model.static or body.inertial.mass == size["mass"], name
        assert body.collisions[0].origin[:3, 3].tolist() == pytest.approx(size["centre"]), name
        assert "model://%s does not exist" % name in model.warning and "line 1" in model.warning

