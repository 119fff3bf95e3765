# SPDX-License-Identifier: BSD-3-Clause
"""Simplified meshes; and no module of the package needs ROS."""
import errno
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lab_testing.meshes import sphere
from world_picture import drawing
from world_picture.pieces import read_pieces


def test_a_mesh_is_simplified_once_and_then_found_again(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / "ball.stl"
    vertices, faces = sphere(60)
    trimesh.Trimesh(0.2 * vertices, faces).export(str(path))
    cache = drawing.DrawingCache(tmp_path / "cache")
    part, = cache.parts(path)
    written = Path(part.path).stat().st_mtime_ns
    sizes = [len(drawing.read_level(level.path)[2]) for level in part.levels]
    assert len(faces) > sizes[0] > sizes[-1] and sizes == sorted(sizes, reverse=True)
    assert [level.error for level in part.levels] == sorted(level.error for level in part.levels)
    plain = Path(part.path).read_text(encoding="ascii")
    assert plain.count("\nf ") == sizes[part.plain] and part.levels[part.plain].error <= drawing.PLAIN * 0.4
    assert part.plain == len(sizes) - 1 or part.levels[part.plain + 1].error > drawing.PLAIN * 0.4
    assert cache.parts(path) == [part] and Path(part.path).stat().st_mtime_ns == written


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


def test_without_room_in_the_cache_a_mesh_is_drawn_all_the_same(tmp_path, monkeypatch):
    folder = tmp_path / "cache"

    def fallocate(number, offset, size):
        if os.readlink("/proc/self/fd/%d" % number).startswith(str(folder)):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(os, "posix_fallocate", fallocate)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    path = tmp_path / "plain.DAE"
    path.write_text(COLLADA, encoding="utf-8")
    part, = drawing.DrawingCache(folder).parts(path)
    assert os.path.exists(part.path) and list(folder.iterdir()) == []


def test_what_killed_programs_have_left_in_the_cache_is_removed_later(tmp_path):
    folder, path = tmp_path / "cache", tmp_path / "plain.DAE"
    path.write_text(COLLADA, encoding="utf-8")
    for name, age_s in ((".draft-killed", 3700.0), (".draft-at_work", 10.0)):
        (folder / name).mkdir(parents=True)
        then = time.time() - age_s
        os.utime(folder / name, (then, then))
    part, = drawing.DrawingCache(folder).parts(path)
    assert {one.name for one in folder.iterdir()} == {".draft-at_work", Path(part.path).parent.name}


def test_two_programs_that_make_the_same_leave_one_result(tmp_path):
    path = tmp_path / "plain.DAE"
    path.write_text(COLLADA, encoding="utf-8")

    class SlowProcess:
        """While it simplifies, another program does, too."""

        def call(self, function, *arguments):
            theirs, = drawing.DrawingCache(tmp_path / "cache").parts(path)
            function(*arguments)
            self.made = theirs

    slow = SlowProcess()
    part, = drawing.DrawingCache(tmp_path / "cache", slow).parts(path)
    assert part == slow.made and len(list((tmp_path / "cache").iterdir())) == 1


def test_a_collada_mesh_has_the_colours_that_its_file_names(tmp_path):
    """rviz and Gazebo show them as they are, without a gamma."""
    path = tmp_path / "red.dae"
    material = """<library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong>
    <ambient><color>0.1 0.1 0.1 1</color></ambient><diffuse><color>0.4 0.2 0.1 1</color></diffuse>
    <specular><color>0.5 0.5 0.5 1</color></specular></phong></technique></profile_COMMON></effect></library_effects>
    <library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
    <library_geometries>"""
    bound = """<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="s" target="#m"/>
    </technique_common></bind_material></instance_geometry>"""
    path.write_text(COLLADA.replace("<library_geometries>", material)
                    .replace('<triangles count="1">', '<triangles count="1" material="s">')
                    .replace('<instance_geometry url="#g"/>', bound), encoding="utf-8")
    part, = drawing.DrawingCache(tmp_path / "cache").parts(path)
    assert part.colour == (0.4, 0.2, pytest.approx(0.1, abs=0.003), 1.0)


def test_a_wavefront_file_has_the_colours_that_its_materials_have_now(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("mtllib a b.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    cache = drawing.DrawingCache(tmp_path / "cache")
    for colour in ((1.0, 0.2, 0.0), (0.0, 0.2, 1.0)):
        (tmp_path / "a b.mtl").write_text("newmtl m\nKd %g %g %g\n" % colour)
        assert cache.parts(path)[0].colour[:3] == pytest.approx(colour, abs=0.003)


def test_a_mirrored_node_is_seen_from_outside(tmp_path):
    path = tmp_path / "mirrored.dae"
    path.write_text(COLLADA.replace("<instance_geometry", "<scale>-1 1 1</scale><instance_geometry"), encoding="utf-8")
    piece, = read_pieces(path)
    corners = piece.vertices[piece.faces[0]]
    # As in the file, its front looks up.
    assert np.cross(corners[1] - corners[0], corners[2] - corners[0])[2] > 0.0 > corners[:, 0].min()


def test_a_terrain_has_fewer_rows_to_look_at_and_keeps_its_size(tmp_path):
    heights = np.tile(np.arange(1025, dtype=np.uint16) * 60, (1025, 1))
    Image.fromarray(heights).save(tmp_path / "slope.png")
    piece, = read_pieces(tmp_path / "slope.png")
    assert len(piece.faces) == 2 * 200 * 200
    low, high = piece.vertices.min(axis=0), piece.vertices.max(axis=0)
    np.testing.assert_allclose((low, high), ((-0.5, -0.5, 0), (0.5, 0.5, 1)))
    np.testing.assert_allclose(piece.vertices[:, 2], piece.vertices[:, 0] + 0.5, atol=0.003)


def test_an_unreadable_mesh_names_its_path(tmp_path):
    with pytest.raises(drawing.DrawingError, match="missing.stl"):
        drawing.DrawingCache(tmp_path).parts(tmp_path / "missing.stl")


def test_the_package_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (("rospy", "rosgraph", "roslib", "rospkg"),)
    names = ("drawing", "reduction", "shared_picture", "snapshot")
    imports = "; ".join("import world_picture." + name for name in names)
    subprocess.run([sys.executable, "-c", block + imports], check=True)
