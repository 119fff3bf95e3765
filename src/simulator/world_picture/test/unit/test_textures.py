# SPDX-License-Identifier: BSD-3-Clause
"""Pictures on surfaces: their files, and meshes in levels of detail that keep them."""
import numpy as np
import pytest
from PIL import Image

from world_picture import drawing, reduction, textures
from world_picture.pieces import read_pieces


@pytest.mark.parametrize(("name", "place"), [
    ("a.png", "meshes"), ("a.png", "materials/textures"), ("../textures/a.png", "textures"),
    ("file:///home/me/a.png", "meshes"), ("C:\\models\\a.png", "materials/textures"), ("a%20b.png", "meshes"),
    ("sub/a.png", "meshes"), ("-s 2 2 1 a.png", "meshes"), ("sub\\a.png", "meshes/sub"),
    ("/home/me/a.png", "materials/textures")])
def test_a_picture_is_found_where_gazebo_finds_it(tmp_path, name, place):
    (tmp_path / "meshes").mkdir()
    (tmp_path / place).mkdir(parents=True, exist_ok=True)
    path = tmp_path / place / ("a b.png" if "%" in name else "a.png")
    path.write_bytes(b"")
    assert textures.find_texture(name, tmp_path / "meshes") == str(tmp_path / "meshes" / name) or (
        path.samefile(textures.find_texture(name, tmp_path / "meshes")))


@pytest.mark.parametrize("name", ["", "b.png", "..", "a\0b", "x" * 5000, "file://"])
def test_other_names_are_not_found(tmp_path, name):
    assert textures.find_texture(name, tmp_path) is None


def test_a_large_picture_is_reduced_once(tmp_path):
    path = tmp_path / "wide.jpg"
    Image.new("RGB", (4000, 1000), (200, 100, 0)).save(path)
    cache = drawing.DrawingCache(tmp_path / "cache")
    found = cache.texture(path)
    assert found.colour == pytest.approx((200 / 255, 100 / 255, 0.0), abs=0.01)
    with Image.open(found.path) as reduced:
        assert reduced.size == (1024, 256) and reduced.mode == "RGB"
    Image.new("RGBA", (3, 2), (0, 0, 255, 10)).save(path.with_suffix(".png"))
    with Image.open(cache.texture(path.with_suffix(".png")).path) as small:
        assert small.mode == "RGBA" and small.getpixel((0, 0)) == (0, 0, 255, 10)
    assert cache.texture(path) == found


def test_meshes_of_one_colour_are_one_piece_whether_they_have_places_in_a_picture_or_not(tmp_path):
    path = tmp_path / "two.obj"
    (tmp_path / "two.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nKd 1 0 0\n")
    path.write_text("mtllib two.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
                    "usemtl b\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 4 5 6\n")
    piece, = read_pieces(path)
    assert len(piece.faces) == 2 and piece.uv is None
    assert sorted(piece.uv is None for piece in read_pieces(path, textured=True)) == [False, True]


def test_a_picture_inside_of_a_file_is_kept_beside_the_parts(tmp_path):
    import trimesh

    pixels = np.zeros((8, 8, 3), dtype=np.uint8)
    pixels[:4], pixels[4:] = (200, 0, 0), (0, 0, 200)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels),
                                                   baseColorFactor=[255, 128, 51, 255])
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)  # upwards, as trimesh has them
    mesh = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], process=False,
                           visual=trimesh.visual.TextureVisuals(uv=uv, material=material))
    mesh.export(str(tmp_path / "board.glb"))
    cache = drawing.DrawingCache(tmp_path / "cache")
    part, = cache.parts(tmp_path / "board.glb")
    assert part.colour == pytest.approx((1.0, 0.5, 0.2, 1.0), abs=0.01)
    with Image.open(textures.find_texture(part.texture, tmp_path)) as found:
        assert found.getpixel((0, 0)) == (200, 0, 0) and found.getpixel((0, 7)) == (0, 0, 200)
    # The upper edge of the board has the upper edge of the picture.
    np.testing.assert_allclose(drawing.read_uv(part.levels[0].path)[:, 1],
                               1.0 - drawing.read_level(part.levels[0].path)[0][:, 1])
    assert cache.texture(part.texture).colour == pytest.approx((0.392, 0.0, 0.392), abs=0.01)
    assert cache.parts(tmp_path / "board.glb") == [part]


def test_what_is_no_picture_is_named(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    path.write_bytes(b"no picture")
    with pytest.raises(drawing.DrawingError, match="picture .*a.png cannot be used: it is no picture in one of the"):
        drawing.DrawingCache(tmp_path / "cache").texture(path)
    with pytest.raises(drawing.DrawingError, match="picture .*b.png cannot be read"):
        drawing.DrawingCache(tmp_path / "cache").texture(tmp_path / "b.png")
    Image.new("L", (200, 100)).save(path)
    monkeypatch.setattr(textures, "_MAX_READ", 10_000)
    with pytest.raises(textures.TextureError, match="200 x 100 pixels"):
        textures.write_texture(path, tmp_path)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 9_000)
    with pytest.raises(textures.TextureError, match="it has more pixels than expected, at most 0 million"):
        textures.write_texture(path, tmp_path)


def barrel(around, high):
    """Vertices, faces and uv of an open cylinder of radius and height 1, with one seam, at y = 0, x = 1."""
    turn, height = np.meshgrid(np.linspace(0.0, 1.0, around + 1), np.linspace(0.0, 1.0, high + 1))
    angle = 2.0 * np.pi * turn.ravel()
    vertices = np.column_stack([np.cos(angle), np.sin(angle), height.ravel()])
    a = (np.arange(high)[:, None] * (around + 1) + np.arange(around)).ravel()
    b = a + around + 1
    faces = np.concatenate([np.column_stack([a, a + 1, b + 1]), np.column_stack([a, b + 1, b])])
    return vertices, faces, np.column_stack([turn.ravel(), 1.0 - height.ravel()])


def test_levels_keep_the_picture_where_it_is():
    """On the coarse barrel each point shows what is there on the fine one, within the level's error, up to the seam."""
    vertices, faces, uv = barrel(180, 40)
    levels = reduction.levels(vertices, faces, uv=uv)
    assert len(levels) >= 3 and len(levels[-1].faces) < 0.02 * len(faces)
    assert len(levels[0].faces) == len(faces) and levels[0].error < 1e-9
    random = np.random.default_rng(4)
    for level in levels:
        share = random.dirichlet((1, 1, 1), len(level.faces))[:, :, None]
        point = (level.vertices[level.faces] * share).sum(axis=1)
        shown = (level.uv[level.faces] * share).sum(axis=1)
        around = np.mod(np.arctan2(point[:, 1], point[:, 0]) / (2.0 * np.pi), 1.0)
        shift = np.abs(np.column_stack([shown[:, 0] - around, shown[:, 1] - (1.0 - point[:, 2])]))
        shift[:, 0] = 2.0 * np.pi * np.minimum(shift[:, 0], 1.0 - shift[:, 0])
        assert shift.max() < 3.0 * level.error + 1e-3


def test_light_has_no_seam():
    vertices, faces, uv = barrel(16, 1)
    level = reduction.levels(vertices, faces, uv=uv)[0]
    assert np.einsum("ij,ij->i", level.normals[:, :2], level.vertices[:, :2]).min() > 0.995


def test_the_shift_of_a_picture_counts_as_an_error():
    """A flat sheet could lose all its inner vertices, but a picture is stretched on one of its halves."""
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.0, 21)))
    a = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    faces = np.concatenate([np.column_stack([a, a + 1, a + 22]), np.column_stack([a, a + 22, a + 21])])
    vertices = np.column_stack([x, y, 0.0 * x])
    even = reduction.levels(vertices, faces, uv=np.column_stack([x, y]))
    uneven = reduction.levels(vertices, faces, uv=np.column_stack([np.where(x < 0.5, 0.5 * x, 1.5 * x - 0.5), y]))
    assert even[1].error < 1e-6 and len(even[1].faces) < 10
    assert len(uneven) == 1, "without inner vertices the picture would be shifted by an eighth"


def test_too_many_triangles_show_one_colour(monkeypatch):
    vertices, faces, uv = barrel(60, 20)
    monkeypatch.setattr(reduction, "_MANY", 1000)
    assert all(level.uv is None for level in reduction.levels(vertices, faces, uv=uv))


def test_a_part_that_has_vanished_is_an_error_though_its_corners_are_left():
    """A frame with a bar across, of 0.7 % of the surface: all corners of the bar belong to the frame as well."""
    xs, ys = (0.0, 0.1, 0.4985, 0.5015, 0.9, 1.0), (0.0, 0.1, 0.9, 1.0)
    vertices = np.array([(x, y, 0.0) for x in xs for y in ys])
    solid = [(i, j) for i in range(5) for j in range(3) if i in (0, 2, 4) or j in (0, 2)]
    faces = np.array([f for i, j in solid for a in [4 * i + j] for f in ((a, a + 4, a + 5), (a, a + 5, a + 1))])
    whole = reduction._original(vertices, faces, 1.0, vertices[:, :2])
    in_bar = np.abs(whole.vertices[whole.faces].mean(axis=1) - (0.5, 0.5, 0.0)).max(axis=1) < 0.3
    assert in_bar.sum() == 2
    without = whole._replace(faces=whole.faces[~in_bar], corner_normals=whole.corner_normals[~in_bar])
    assert reduction._level(whole, whole).error < 1e-9
    # The middle of each of its triangles is a third of its width from the hole's side.
    assert reduction._level(whole, without).error > 0.003 / 3.01
