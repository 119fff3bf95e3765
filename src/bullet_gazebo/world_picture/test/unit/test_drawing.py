# SPDX-License-Identifier: BSD-3-Clause
"""Simplified meshes; and no module of the package needs ROS."""
import subprocess
import sys
from pathlib import Path

import numpy as np
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
    # Quadric error stops a little above its target.
    assert least < Path(part.path).read_text(encoding="ascii").count("\nf ") <= 1.1 * most
    assert len(drawing.read_fine(part.fine)[1]) > 2 * least
    assert cache.parts(path) == [part] and Path(part.path).stat().st_mtime_ns == written


def area(vertices, faces):
    corners = vertices[faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2.0


def sheet(count):
    """A square of 1 m in the plane z = 0, of count * count squares."""
    ticks = np.linspace(0.0, 1.0, count + 1)
    x, y = np.meshgrid(ticks, ticks)
    corner = np.arange(count)[:, None] * (count + 1) + np.arange(count)
    faces = np.stack([corner, corner + 1, corner + count + 2, corner, corner + count + 2, corner + count + 1], axis=-1)
    return np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3), faces.reshape(-1, 3)


def test_flat_parts_become_few_triangles_and_their_outline_stays():
    vertices, faces = sheet(40)
    bent = np.concatenate([vertices, vertices[:, [2, 1, 0]]])  # two sheets that meet at a right angle
    kept, corners = drawing.reduced(bent, np.concatenate([faces, faces + len(vertices)]), 60)
    assert len(corners) <= 66 and area(kept, corners) == pytest.approx(2.0, rel=0.06)
    assert np.ptp(kept, axis=0) == pytest.approx([1.0, 1.0, 1.0], abs=0.03)
    # On a grid as coarse as this the corner would be rounded.
    assert np.minimum(abs(kept[:, 0]), abs(kept[:, 2])).max() < 1e-3


def test_loose_pieces_are_not_lost():
    """A thousand separate triangles, as of a scanned or badly exported mesh: there is no edge to collapse."""
    rng = np.random.default_rng(3)
    corners = sphere(20)[0][sphere(20)[1]]
    loose = (corners + rng.uniform(-1e-4, 1e-4, (len(corners), 1, 3))).reshape(-1, 3)
    faces = np.arange(len(loose)).reshape(-1, 3)
    kept, left = drawing.reduced(loose, faces, len(faces) // 3)
    assert len(left) <= 1.7 * len(faces) / 3
    assert area(kept, left) == pytest.approx(area(loose, faces), rel=0.15)


def test_an_unreadable_mesh_names_its_path(tmp_path):
    with pytest.raises(drawing.DrawingError, match="missing.stl"):
        drawing.DrawingCache(tmp_path).parts(tmp_path / "missing.stl")


def test_the_package_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (("rospy", "rosgraph", "roslib", "rospkg"),)
    names = ("drawing", "shared_picture", "snapshot")
    imports = "; ".join("import world_picture." + name for name in names)
    subprocess.run([sys.executable, "-c", block + imports], check=True)
