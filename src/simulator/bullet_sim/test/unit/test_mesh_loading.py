# SPDX-License-Identifier: BSD-3-Clause
"""Untrusted meshes: a hostile one is refused with an error that names the limit, a large one is simplified."""

import errno
import os
import struct
import tempfile
import zipfile

import numpy as np
import pytest
from PIL import Image

from bullet_sim import BulletSimError, MeshCache, MeshFiles, Pose, World
from bullet_sim.mesh_loading import MAX_HOLLOW_TRIANGLES, MAX_HULL_POINTS, MeshError, hull_points, to_wavefront
from urdf_model import Mesh, parse_urdf

NO_ROOM = os.strerror(errno.ENOSPC)  # in the user's language

COLLADA = """<?xml version="1.0"?>%s<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>%s</COLLADA>"""


def bumpy_ball(across):
    """Vertices and faces of a ball of 1 m radius, 2 * ``across`` ** 2 triangles."""
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, across + 1), np.linspace(0.01, np.pi - 0.01, across + 1))
    radius = 1.0 - 0.02 * np.cos(20.0 * u) ** 2 * np.sin(v)
    points = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1) * radius[..., None]
    i = (np.arange(across)[:, None] * (across + 1) + np.arange(across)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + across + 1], 1),
                            np.stack([i + 1, i + across + 2, i + across + 1], 1)])
    return points.reshape(-1, 3), faces


def write_stl(path, vertices, faces, announced=None):
    corners = vertices[faces].astype("<f4")
    records = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    records["corners"] = corners
    count = struct.pack("<I", len(faces) if announced is None else announced)
    path.write_bytes(b"\0" * 80 + count + records.tobytes())
    return str(path)


def points_of(path):
    with open(path, encoding="ascii") as file:
        lines = [line.split() for line in file]
    return (np.array([words[1:] for words in lines if words[0] == "v"], dtype=float),
            sum(words[0] == "f" for words in lines))


@pytest.fixture
def told():
    return []


@pytest.fixture
def cache(tmp_path, told):
    return MeshCache(tmp_path / "cache", told.append)


def bomb(path):
    entities = "".join("<!ENTITY e%d '%s'>" % (k, ("&e%d;" % (k - 1) if k else "aaaaaaaaaa") * 10) for k in range(9))
    path.write_text(COLLADA % ("<!DOCTYPE c [%s]>" % entities, "<extra>&e8;</extra>"))


def outside(path):
    path.write_text(COLLADA % ("<!DOCTYPE c [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>", "<extra>&a;</extra>"))


def archive(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("a.dae", b" " * 50_000_000)


def sparse(path):
    with open(path, "wb") as file:
        file.truncate(2**33)


@pytest.mark.parametrize("name, make, message", [
    ("bomb.dae", bomb, "declares the entit|entity reference loop|amplification"),
    ("outside.dae", outside, "declares the entity a"),
    ("archive.dae", archive, "cannot be used"),
    ("archive.zae", archive, "in the format 'zae'; expected one of dae, stl, obj"),
    ("pipe.stl", os.mkfifo, "a named pipe, not a file"),
    ("device.stl", lambda path: path.symlink_to("/dev/zero"), "a device, not a file"),
    ("empty.stl", lambda path: path.write_bytes(b""), "it is empty"),
    ("lie.stl", lambda path: write_stl(path, *bumpy_ball(4), announced=2**32 - 1), "cannot be used"),
    ("far.stl", lambda path: write_stl(path, 1e30 * bumpy_ball(4)[0], bumpy_ball(4)[1]), "corner is at .* most 1e.07"),
    ("nan.stl", lambda path: write_stl(path, np.nan * bumpy_ball(4)[0], bumpy_ball(4)[1]), "cannot be used"),
    ("sparse.stl", sparse, "expected at most 100000000"),
    ("text.obj", lambda path: path.write_text("v 0 0 0\n" * 10), "cannot be used"),
    ("large.png", lambda path: Image.new("L", (1026, 1025)).save(path), "1026 x 1025 heights; expected"),
    ("flat.png", lambda path: Image.new("L", (9, 1)).save(path), "9 x 1 heights"),
    ("text.png", lambda path: path.write_text("P"), "cannot be used"),
    ("x.exe", lambda path: path.write_text("MZ"), "in the format 'exe'"),
])
def test_what_is_hostile_is_refused_with_its_reason(tmp_path, cache, name, make, message):
    make(tmp_path / name)
    with pytest.raises(BulletSimError, match=message):
        cache.wavefront(tmp_path / name)
    assert not [file for file in (tmp_path / "cache").glob("*") if file.name.startswith(".draft-")]


@pytest.mark.parametrize("name", ["http://example.org/a.stl", "https://example.org/a.dae"])
def test_nothing_is_fetched(name):
    with pytest.raises(BulletSimError, match="not fetched over the network"):
        MeshFiles(lambda uri: None).wavefront(Mesh(name))


@pytest.mark.parametrize("make, message", [(os.mkfifo, "a named pipe, not a file")])
def test_what_is_drawn_must_be_a_file_too(tmp_path, make, message):
    make(tmp_path / "a.stl")
    with pytest.raises(BulletSimError, match=message):
        MeshFiles(lambda uri: str(tmp_path / "a.stl")).path(Mesh("a.stl"))


def test_materials_outside_of_the_folder_are_not_read(tmp_path, cache):
    (tmp_path / "models").mkdir()
    os.mkfifo(tmp_path / "secret.mtl")
    vertices, faces = bumpy_ball(4)
    lines = ["mtllib ../secret.mtl"] + ["v %g %g %g" % tuple(v) for v in vertices]
    (tmp_path / "models" / "a.obj").write_text("\n".join(lines + ["f %d %d %d" % tuple(f) for f in faces + 1]))
    assert points_of(cache.wavefront(tmp_path / "models" / "a.obj"))[1] > 20


def test_a_large_mesh_is_thinned_out_and_says_so(tmp_path, cache, told):
    path = write_stl(tmp_path / "large.stl", *bumpy_ball(354))  # 250,632 triangles
    points, triangles = points_of(cache.wavefront(path))
    assert 0.8 * MAX_HOLLOW_TRIANGLES < triangles <= MAX_HOLLOW_TRIANGLES
    assert np.abs(np.linalg.norm(points, axis=1) - 0.99).max() < 0.03
    assert len(told) == 1 and "thinned out from 250632 triangles" in told[0]
    hull, _ = points_of(cache.wavefront(path, hollow=False))
    assert 700 < len(hull) <= 1_500
    assert np.ptp(hull, axis=0) == pytest.approx([2.0, 2.0, 2.0], abs=0.02)


def test_a_usual_mesh_stays_as_it_is(tmp_path, cache, told):
    vertices, faces = bumpy_ball(40)
    path = write_stl(tmp_path / "usual.stl", vertices, faces)
    points, triangles = points_of(cache.wavefront(path))
    assert triangles == len(faces) and told == []
    assert cache.wavefront(path, hollow=False) == cache.wavefront(path)


def test_a_hull_keeps_its_size():
    points = np.random.default_rng(1).normal(size=(MAX_HULL_POINTS * 5, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    kept = hull_points(points)
    assert len(kept) <= 1_500
    for direction in np.random.default_rng(2).normal(size=(200, 3)):
        direction = direction / np.linalg.norm(direction)
        assert (kept @ direction).max() > 0.995 * (points @ direction).max()


# -- heights ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_picture_is_a_terrain_whose_brightest_point_is_the_highest(tmp_path, cache, kind):
    Image.fromarray(np.array([[0, 50, 100], [0, 0, 200]], dtype=kind)).save(tmp_path / "hills.png")
    points, triangles = points_of(cache.wavefront(tmp_path / "hills.png"))
    # x along a row; the first row at the greatest y, as on a map.
    assert sorted(points.tolist()) == [[-0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, -0.5, 0.0], [0.0, 0.5, 0.25],
                                       [0.5, -0.5, 1.0], [0.5, 0.5, 0.5]]
    assert triangles == 4


def test_a_box_rests_on_a_terrain_where_it_is_as_high(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    Image.fromarray(np.tile(np.arange(33, dtype=np.uint8), (33, 1))).save(tmp_path / "slope.png")
    world = World(time_step_s=0.002)
    shape = "<collision><geometry>%s</geometry></collision>"
    world.spawn(parse_urdf('<robot name="t"><link name="l">%s</link></robot>' % shape % (
        '<mesh filename="%s" scale="8 8 1"/>' % (tmp_path / "slope.png"))), "terrain", static=True)
    inertial = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>'
    box = world.spawn(parse_urdf('<robot name="b"><link name="l">%s%s</link></robot>' % (
        inertial, shape % '<box size="0.2 0.2 0.2"/>')), "box", Pose((2.0, 0.0, 1.0)))
    for _ in range(1000):
        world.step()
    x, _, z = box.base_pose().position
    world.close()
    assert x == pytest.approx(2.0, abs=0.1)
    # The middle of the box is 0.1 m away from the slope of one in eight.
    assert z == pytest.approx((x + 4.0) / 8.0 + 0.1 * np.hypot(1.0, 1.0 / 8.0), abs=0.01)


TRIANGLE = """<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">
0 0 0 10 0 0 0 20 5</float_array><technique_common><accessor source="#a" count="3" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="v">
<input semantic="POSITION" source="#p"/></vertices><triangles count="1">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>0 0 1</translate><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene>"""


@pytest.mark.parametrize(("unit", "metres"), [
    ("", 1.0), ('<unit meter="0.0254" name="inch"/>', 0.0254), ('<unit name="furlong"/>', 1.0),
    ('<unit meter="many"/>', 1.0), ('<unit meter="-1"/>', 1.0), ('<unit meter="nan"/>', 1.0)])
def test_a_collada_mesh_is_as_large_as_its_unit_says(tmp_path, unit, metres):
    path = tmp_path / "triangle.dae"
    path.write_text((COLLADA % ("", TRIANGLE)).replace("<up_axis>", unit + "<up_axis>"))
    to_wavefront(str(path), str(tmp_path / "triangle.obj"), ())
    assert np.ptp(points_of(tmp_path / "triangle.obj")[0], axis=0) == pytest.approx(metres * np.array([10, 20, 5]))
    assert points_of(tmp_path / "triangle.obj")[0][:, 2].min() == pytest.approx(metres)


def test_a_mesh_that_its_unit_makes_too_large_is_refused(tmp_path):
    path = tmp_path / "triangle.dae"
    path.write_text((COLLADA % ("", TRIANGLE)).replace("<up_axis>", '<unit meter="1e6"/><up_axis>'))
    with pytest.raises(MeshError, match="a corner is at 2e[+]07; expected at most 1e[+]07"):
        to_wavefront(str(path), str(tmp_path / "triangle.obj"), ())


TWO_NODES = TRIANGLE.replace("<node><translate>", '<node id="n" name="up"><translate>', 1)
TWO_NODES = TWO_NODES.replace("</visual_scene>", '<node id="down"><node><translate>0 0 -3</translate>'
                              '<instance_geometry url="#g"/></node></node></visual_scene>')


@pytest.mark.parametrize(("part", "low", "high"), [
    (("", False), (0, 0, -3), (10, 20, 6)), (("up", False), (0, 0, 1), (10, 20, 6)),
    (("down", False), (0, 0, -3), (10, 20, 2)), (("up", True), (-5, -10, -2.5), (5, 10, 2.5))])
def test_a_part_of_a_mesh_is_a_node_of_its_file(tmp_path, cache, part, low, high):
    path = tmp_path / "two.dae"
    path.write_text((COLLADA % ("", TWO_NODES)).replace("<up_axis>", '<unit meter="0.1"/><up_axis>'))
    points, _ = points_of(cache.wavefront(str(path), part=part))
    assert points.min(axis=0) == pytest.approx(0.1 * np.array(low))
    assert points.max(axis=0) == pytest.approx(0.1 * np.array(high))


def test_a_part_that_is_not_there_is_named_with_those_that_are(tmp_path, cache):
    path = tmp_path / "two.dae"
    path.write_text(COLLADA % ("", TWO_NODES))
    with pytest.raises(BulletSimError, match="it has no part 'left'; it has down, up"):
        cache.wavefront(str(path), part=("left", False))
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(BulletSimError, match="it has no part 'left'; it has none"):
        cache.wavefront(str(tmp_path / "a.obj"), part=("left", False))
    path = write_stl(tmp_path / "a.stl", np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(BulletSimError, match="it has no part 'left'; only Collada and Wavefront files have parts"):
        cache.wavefront(path, part=("left", False))


@pytest.mark.parametrize(("part", "low", "high"), [
    (("", False), (0, 0, 0), (1, 1, 5)), (("low", False), (0, 0, 0), (1, 1, 0)),
    (("a high one", False), (0, 0, 5), (1, 1, 5)), (("a high one", True), (-0.5, -0.5, 0), (0.5, 0.5, 0))])
def test_a_part_of_a_wavefront_file_is_a_group_or_an_object(tmp_path, cache, part, low, high):
    path = tmp_path / "two.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\no low\nf 1 2 3\nv 0 0 5\nv 1 0 5\nv 0 1 5\ng a high one\nf 4 5 6\n")
    points, triangles = points_of(cache.wavefront(str(path), part=part))
    assert points.min(axis=0) == pytest.approx(low) and points.max(axis=0) == pytest.approx(high)
    assert triangles == (1 if part[0] else 2)


MATERIAL = """<library_images><image id="i">%s</image></library_images><library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam><technique sid="c"><phong><diffuse>
<texture texture="t" texcoord="UV"/></diffuse></phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>"""
BOUND = """<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="x" target="#m"/>
</technique_common></bind_material></instance_geometry>"""


@pytest.mark.parametrize("broken", [
    lambda text: text, lambda text: text.replace("<image id", "<image name='n' id"),
    lambda text: text.replace('url="#e"', 'url="#f"'), lambda text: text.replace('target="#m"', 'target="#n"'),
    lambda text: text.replace('target="#m"', "")])
def test_geometry_stays_where_its_material_is_broken(tmp_path, broken):
    text = broken(COLLADA % ("", MATERIAL % "<!-- a.png -->" + TRIANGLE.replace(
        '<instance_geometry url="#g"/>', BOUND).replace('<triangles count', '<triangles material="x" count')))
    path = tmp_path / "triangle.dae"
    path.write_text(text)
    to_wavefront(str(path), str(tmp_path / "triangle.obj"), ())
    assert points_of(tmp_path / "triangle.obj")[1] == 1


def test_comments_in_geometry_do_not_count(tmp_path):
    path = tmp_path / "triangle.dae"
    path.write_text(COLLADA % ("", TRIANGLE.replace("<mesh>", "<!-- a --><mesh><!-- b -->")))
    to_wavefront(str(path), str(tmp_path / "triangle.obj"), ())
    assert points_of(tmp_path / "triangle.obj")[1] == 1


@pytest.mark.parametrize("unit", ["", '<unit meter="0.1"/>'])
def test_a_collada_file_without_geometry_says_so(tmp_path, unit):
    path = tmp_path / "nothing.dae"
    path.write_text((COLLADA % ("", TRIANGLE.replace('<instance_geometry url="#g"/>', ""))).replace(
        "<up_axis>", unit + "<up_axis>"))
    with pytest.raises(MeshError, match="it holds no triangles"):
        to_wavefront(str(path), str(tmp_path / "nothing.obj"), ())


def small_mesh(path):
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n")
    return path


def full_disks(monkeypatch, *folders):
    """No file can be made below these folders."""
    def fallocate(number, offset, size):
        if os.readlink("/proc/self/fd/%d" % number).startswith(tuple(map(str, folders))):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(os, "posix_fallocate", fallocate)


def test_without_room_in_the_cache_meshes_are_made_elsewhere_and_a_warning_says_so(tmp_path, cache, told, monkeypatch):
    full_disks(monkeypatch, tmp_path / "cache")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    first = cache.wavefront(small_mesh(tmp_path / "a.obj"), hollow=False)
    second = cache.keep(b"two", lambda: ["v 0 0 0"])
    assert os.path.exists(first) and os.path.exists(second)
    assert not {os.path.dirname(first), os.path.dirname(second)} & {str(tmp_path / "cache")}
    assert len(told) == 1 and "%s: %s" % (tmp_path / "cache", NO_ROOM) in told[0]


def test_no_room_anywhere_is_said_as_such(tmp_path, cache, monkeypatch):
    full_disks(monkeypatch, tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(BulletSimError, match="no room for a converted mesh .* %s; delete some" % NO_ROOM):
        cache.wavefront(small_mesh(tmp_path / "a.obj"))
