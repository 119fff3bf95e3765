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
    assert len(drawing.read_fine(part.fine)[1]) > least
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


def test_open_sheets_keep_their_borders_within_the_tolerance():
    """Two flat sheets and a curved one that touches neither: their error would not change if they shrank."""
    flat, faces = sheet(40)
    beside = flat + (1.5, 0.0, 0.2)
    bowl = flat + np.stack([np.full(len(flat), -1.5), np.zeros(len(flat)), 0.3 * flat[:, 0] ** 2], axis=1)
    vertices = np.concatenate([flat, beside, bowl])
    kept, left = drawing.within(vertices, np.concatenate([faces + k * len(flat) for k in range(3)]), 0.01, 10_000)
    assert len(left) < len(faces) / 4
    assert area(kept, left) == pytest.approx(2.0 + area(bowl, faces), rel=0.005)
    for original, inside in ((flat, kept[:, 0] > -0.25), (beside, kept[:, 0] > 1.25), (bowl, kept[:, 0] < -0.25)):
        mine = kept[inside & (kept[:, 0] < 1.25)] if original is flat else kept[inside]
        assert mine.min(axis=0) == pytest.approx(original.min(axis=0), abs=0.02)
        assert mine.max(axis=0) == pytest.approx(original.max(axis=0), abs=0.02)


def test_at_most_so_many_triangles_are_left():
    vertices, faces = sphere(60)
    assert len(drawing.within(vertices, faces, 1e-4, 500)[1]) <= 500


COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0
</float_array><technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source><vertices id="v">
<input semantic="POSITION" source="#p"/></vertices><triangles count="1">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


def test_a_collada_mesh_without_material_is_as_grey_as_in_rviz(tmp_path):
    path = tmp_path / "plain.DAE"
    path.write_text(COLLADA, encoding="utf-8")
    part, = drawing.DrawingCache(tmp_path / "cache").parts(path)
    assert part.colour == (0.6, 0.6, 0.6, 1.0)


def test_an_unreadable_mesh_names_its_path(tmp_path):
    with pytest.raises(drawing.DrawingError, match="missing.stl"):
        drawing.DrawingCache(tmp_path).parts(tmp_path / "missing.stl")


def test_the_package_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (("rospy", "rosgraph", "roslib", "rospkg"),)
    names = ("drawing", "shared_picture", "snapshot")
    imports = "; ".join("import world_picture." + name for name in names)
    subprocess.run([sys.executable, "-c", block + imports], check=True)
