# SPDX-License-Identifier: BSD-3-Clause
"""Simplified meshes; and no module of the package needs ROS."""
import subprocess
import sys
from pathlib import Path

import pytest

from lab_testing.meshes import sphere
from world_picture import drawing


@pytest.mark.parametrize(("size_m", "least", "most"), [
    (0.05, 100, 250), (drawing.USUAL_M, 250, 500), (3.0, 750, 1250)])
def test_a_mesh_is_thinned_by_its_size_once_and_then_found_again(tmp_path, size_m, least, most):
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / "ball.stl"
    vertices, faces = sphere(60)
    trimesh.Trimesh(vertices * size_m / 2.0, faces).export(str(path))
    cache = drawing.DrawingCache(tmp_path / "cache", triangles=500)
    part, = cache.parts(path)
    written = Path(part.path).stat().st_mtime_ns
    assert least < Path(part.path).read_text(encoding="ascii").count("\nf ") <= most
    assert cache.parts(path) == [part] and Path(part.path).stat().st_mtime_ns == written


def test_an_unreadable_mesh_names_its_path(tmp_path):
    with pytest.raises(drawing.DrawingError, match="missing.stl"):
        drawing.DrawingCache(tmp_path).parts(tmp_path / "missing.stl")


def test_the_package_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (("rospy", "rosgraph", "roslib", "rospkg"),)
    names = ("drawing", "shared_picture", "snapshot")
    imports = "; ".join("import world_picture." + name for name in names)
    subprocess.run([sys.executable, "-c", block + imports], check=True)
