# SPDX-License-Identifier: BSD-3-Clause
"""Meshes drawn from the front alone where nothing shows their backs."""
import numpy as np
import pytest

from lab_testing.meshes import sphere
from sensor_renderer.drawn_links import DrawnLink, visible
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from sensor_renderer.sides import Sides, indexed
from urdf_model.transforms import pose_matrix
from world_picture.drawing import DrawingCache

URDF = """<robot name="thing"><link name="link"><visual><geometry><mesh filename="%s"/></geometry>
<material name="r"><color rgba="0.9 0 0 1"/></material></visual></link></robot>"""
PINHOLE = Pinhole.from_field_of_view(320, 320, 1.0, 0.05, 20.0)
# From above, aslant.
ABOVE = pose_matrix((-0.6, 0.0, 0.9), (0.0, 0.98, 0.0)) @ OPTICAL
INSIDE = OPTICAL
FROM_AFAR = pose_matrix((-2.4, 0.0, 2.0), (0.0, 0.7, 0.0)) @ OPTICAL


@pytest.fixture(scope="module")
def renderer(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patched:
        # Nothing that an earlier run found.
        patched.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        with_gl = GlRenderer()
    if not with_gl._one_sided:
        pytest.skip("a graphics card draws both sides")
    yield with_gl
    with_gl.close()


def mesh(name):
    vertices, faces = sphere(24)
    vertices = 0.3 * vertices
    if name == "bowl":
        faces = faces[vertices[faces][:, :, 2].max(axis=1) < 0.03]
    elif name == "inside out":
        faces = faces[:, ::-1]
    return vertices, faces


def mirror_of(name, tmp_path, above_floor_m=None):
    import trimesh

    trimesh.Trimesh(*mesh(name), process=False).export(str(tmp_path / "thing.stl"))
    mirror = Mirror(DrawingCache(tmp_path / "cache"), lambda uri: uri, pytest.fail)
    scene = [{"name": "thing", "urdf": URDF % (tmp_path / "thing.stl"), "joints": []}]
    poses = [0.0, 0.0, above_floor_m or 0.0, 0.0, 0.0, 0.0, 1.0]
    if above_floor_m is not None:
        scene.append({"name": "floor", "urdf": None, "joints": []})
        poses += [0.0] * 6 + [1.0]
    mirror.set_scene(scene)
    mirror.set_state(np.array(poses))
    return mirror


@pytest.mark.parametrize("which", [Sides.from_behind, Sides.plainly_from_behind], ids=["pictures", "shadows"])
@pytest.mark.parametrize(("name", "share"), [("ball", 0.0), ("bowl", 1.0), ("inside out", 1.0)])
def test_a_triangle_is_drawn_from_behind_where_its_back_can_be_seen(renderer, which, name, share):
    vertices, faces = mesh(name)
    behind = which(renderer._links._sides, vertices[faces].reshape(-1, 3), np.zeros(3), 0.3)
    assert behind.shape == (len(faces),)
    # At the outline, some pixels show backs.
    assert abs(behind.mean() - share) < 0.05


@pytest.mark.parametrize("name", ["ball", "bowl", "inside out"])
@pytest.mark.parametrize("pose", [ABOVE, INSIDE], ids=["above", "inside"])
def test_a_picture_is_that_of_both_sides(renderer, monkeypatch, tmp_path, name, pose):
    mirror = mirror_of(name, tmp_path)
    one_sided, _ = renderer.render(mirror, PINHOLE, pose)
    monkeypatch.setattr(renderer, "_one_sided", False)
    both_sides, _ = renderer.render(mirror, PINHOLE, pose)
    assert (both_sides[..., 0] > both_sides[..., 2] + 50).mean() > 0.1, "the mesh is in the picture"
    differ = np.abs(one_sided.astype(int) - both_sides).max(axis=2) > 8
    assert differ.mean() < 0.001


@pytest.mark.parametrize("name", ["ball", "bowl", "inside out"])
def test_a_shadow_is_that_of_both_sides(renderer, monkeypatch, tmp_path, name):
    mirror = mirror_of(name, tmp_path, above_floor_m=0.6)
    one_sided, _ = renderer.render(mirror, PINHOLE, FROM_AFAR)
    lit = floor_without_shadow(renderer, mirror, monkeypatch)
    monkeypatch.setattr(renderer._shadows, "_one_sided", False)
    monkeypatch.setattr(renderer._shadows, "_drawn", None)
    both_sides, _ = renderer.render(mirror, PINHOLE, FROM_AFAR)
    dark = np.abs(both_sides.astype(int) - lit).max(axis=2) > 20
    assert dark.sum() > 500, "the shadow is in the picture"
    assert (np.abs(one_sided.astype(int) - both_sides).max(axis=2) > 20).sum() < 0.02 * dark.sum()


def test_the_backs_of_a_link_are_looked_for_once(renderer, monkeypatch, tmp_path):
    def first_picture():
        return renderer.render(mirror_of("bowl", tmp_path, above_floor_m=0.6), PINHOLE, FROM_AFAR)[0]

    before = first_picture()
    renderer._links.clear()
    for name in ("from_behind", "plainly_from_behind"):
        monkeypatch.setattr(Sides, name, lambda *_: pytest.fail("looked again"))
    assert np.array_equal(first_picture(), before)


def floor_without_shadow(renderer, mirror, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(renderer._shadows, "_draw_from", lambda *_: None)
        patched.setattr(renderer._shadows, "_drawn", None)
        return renderer.render(mirror, PINHOLE, FROM_AFAR)[0]


def test_fewer_triangles_are_drawn_of_a_closed_mesh(renderer, tmp_path):
    mirror = mirror_of("ball", tmp_path)
    renderer.render(mirror, PINHOLE, ABOVE)
    (link, _, _), = renderer._links.everything(mirror)
    assert link.by_level
    for arrays in link.by_level.values():
        assert arrays.corners <= arrays.colour.vertices < 1.1 * arrays.corners


def test_rows_are_numbered_in_the_order_of_their_use():
    rows = np.float32([[3, 1], [0.0, 2], [3, 1], [-0.0, 2], [1, 1]])
    unique, index = indexed(rows)
    assert unique.tolist() == [[3, 1], [0, 2], [1, 1]]
    assert index.tolist() == [0, 1, 0, 1, 2]


@pytest.mark.parametrize(("place", "seen"), [((0.0, 0.0, 1.0), True), ((0.9, 0.0, 1.0), False),
                                             ((0.0, 0.0, -0.1), False)], ids=["ahead", "beside", "behind"])
def test_a_long_link_is_drawn_if_its_box_is_in_view_not_its_sphere(place, seen):
    rod = DrawnLink(np.zeros(3), np.array([0.02, 1.0, 0.02]), 1.0, False)
    assert bool(visible([(rod, pose_matrix(place, (0.0, 0.0, 0.0)), None)], PINHOLE, np.eye(4))) == seen
