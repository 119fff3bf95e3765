# SPDX-License-Identifier: BSD-3-Clause
"""Levels of detail: how far they are from the original, their borders and their normals."""
import numpy as np
import pytest

from lab_testing.meshes import sphere
from world_picture import reduction


def area(vertices, faces):
    corners = vertices[faces].astype(float)
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2.0


def sheet(count):
    """A square of 1 m in the plane z = 0, of count * count squares."""
    ticks = np.linspace(0.0, 1.0, count + 1)
    x, y = np.meshgrid(ticks, ticks)
    corner = np.arange(count)[:, None] * (count + 1) + np.arange(count)
    faces = np.stack([corner, corner + 1, corner + count + 2, corner, corner + count + 2, corner + count + 1], axis=-1)
    return np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3), faces.reshape(-1, 3)


@pytest.mark.parametrize("radius", [0.01, 1.0, 400.0])
def test_a_ball_has_levels_that_say_how_far_they_are_from_it(radius):
    """In whatever unit: a file in millimetres is reduced like one in metres."""
    vertices, faces = sphere(80)
    found = reduction.levels(radius * vertices, faces)
    assert len(found) >= 3
    counts, errors = [len(level.faces) for level in found], [level.error for level in found]
    assert counts == sorted(counts, reverse=True) and errors == sorted(errors)
    assert counts[0] < len(faces) / 2 and counts[-1] < 500
    assert errors[-1] <= reduction.FARTHEST * 2.0 * radius
    for level in found:
        # The points of a triangle that are farthest from the ball: its corners and its middle.
        corners = level.vertices[level.faces].astype(float)
        away = np.abs(np.linalg.norm(np.concatenate([corners.reshape(-1, 3), corners.mean(axis=1)]), axis=1) - radius)
        assert np.quantile(away, 0.99) <= 1.5 * level.error + 1e-4 * radius
        assert level.error <= 1.5 * away.max()


def test_a_coarse_ball_is_still_shaded_as_a_round_one():
    vertices, faces = sphere(80)
    coarse = reduction.levels(vertices, faces)[-1]
    outwards = coarse.vertices / np.linalg.norm(coarse.vertices, axis=1)[:, None]
    cosines = np.abs(np.einsum("ij,ij->i", coarse.normals, outwards))
    assert np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))).max() < 8.0
    # Facets have other normals at the same corners.
    corners = coarse.vertices[coarse.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    at_corners = np.abs(np.einsum("mi,mki->mk", flat, outwards[coarse.faces]))
    assert np.degrees(np.arccos(np.clip(at_corners, -1.0, 1.0))).max() > 10.0


def test_edges_stay_sharp_and_faces_flat():
    flat, faces = sheet(30)
    bent = np.concatenate([flat, flat[:, [2, 1, 0]]])  # two sheets that meet at a right angle
    for level in reduction.levels(bent, np.concatenate([faces, faces + len(flat)])):
        assert np.abs(level.normals).max(axis=1) == pytest.approx(1.0, abs=1e-6)
        assert np.minimum(abs(level.vertices[:, 0]), abs(level.vertices[:, 2])).max() < 1e-3
        assert np.ptp(level.vertices, axis=0) == pytest.approx([1.0, 1.0, 1.0], abs=0.01)
        assert area(level.vertices, level.faces) == pytest.approx(2.0, rel=0.01)


def test_open_sheets_keep_their_borders():
    """Two flat sheets and a curved one that touches neither: their error would not change if they shrank."""
    flat, faces = sheet(40)
    beside = flat + (1.5, 0.0, 0.2)
    bowl = flat + np.stack([np.full(len(flat), -1.5), np.zeros(len(flat)), 0.3 * flat[:, 0] ** 2], axis=1)
    found = reduction.levels(np.concatenate([flat, beside, bowl]),
                             np.concatenate([faces + k * len(flat) for k in range(3)]))
    level = max((level for level in found if level.error < 0.005), key=lambda level: level.error)
    assert len(level.faces) < len(faces) / 4
    assert area(level.vertices, level.faces) == pytest.approx(2.0 + area(bowl, faces), rel=0.01)
    kept = level.vertices
    for original, inside in ((flat, (kept[:, 0] > -0.25) & (kept[:, 0] < 1.25)), (beside, kept[:, 0] > 1.25),
                             (bowl, kept[:, 0] < -0.25)):
        assert kept[inside].min(axis=0) == pytest.approx(original.min(axis=0), abs=0.02)
        assert kept[inside].max(axis=0) == pytest.approx(original.max(axis=0), abs=0.02)


def loose_triangles():
    rng = np.random.default_rng(3)
    corners = sphere(20)[0][sphere(20)[1]]
    loose = (corners + rng.uniform(-1e-3, 1e-3, (len(corners), 1, 3))).reshape(-1, 3)
    return loose, np.arange(len(loose)).reshape(-1, 3)


def test_loose_triangles_are_not_lost():
    """Separate triangles, as of a scanned or badly exported mesh: there is no edge to collapse."""
    loose, faces = loose_triangles()
    for level in reduction.levels(loose, faces):
        assert area(level.vertices, level.faces) == pytest.approx(area(loose, faces), rel=0.1)


def test_a_reduction_to_a_number_keeps_flat_parts_and_their_outline():
    flat, faces = sheet(40)
    bent = np.concatenate([flat, flat[:, [2, 1, 0]]])
    kept, corners = reduction.reduced(bent, np.concatenate([faces, faces + len(flat)]), 60)
    assert len(corners) <= 66 and area(kept, corners) == pytest.approx(2.0, rel=0.06)
    assert np.ptp(kept, axis=0) == pytest.approx([1.0, 1.0, 1.0], abs=0.03)
    # On a grid as coarse as this the corner would be rounded.
    assert np.minimum(abs(kept[:, 0]), abs(kept[:, 2])).max() < 1e-3


def test_a_reduction_to_a_number_loses_no_loose_triangles():
    loose, faces = loose_triangles()
    kept, left = reduction.reduced(loose, faces, len(faces) // 3)
    assert len(left) <= 1.7 * len(faces) / 3
    assert area(kept, left) == pytest.approx(area(loose, faces), rel=0.15)


def test_there_are_never_more_triangles_than_the_most(monkeypatch):
    loose, faces = loose_triangles()
    monkeypatch.setattr(reduction, "MOST", 300)
    for vertices, triangles in ((loose, faces), sphere(60)):
        found = reduction.levels(vertices, triangles)
        assert found and all(len(level.faces) <= 300 for level in found)
        assert all(0.0 < level.error < 0.5 for level in found)


def test_a_few_triangles_stay_as_they_are():
    vertices, faces = sheet(2)
    level, = reduction.levels(vertices, faces)
    assert len(level.faces) == len(faces) and level.error == 0.0


@pytest.mark.parametrize("faces", [np.zeros((0, 3), dtype=int), np.array([[0, 1, 1]]), np.array([[0, 1, 2]])])
def test_triangles_without_area_are_left_out(faces):
    assert reduction.levels(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]), faces) == []


def test_distances_from_triangles():
    rng = np.random.default_rng(5)
    points, triangles = rng.normal(size=(300, 3)), rng.normal(size=(300, 3, 3))
    found = reduction.point_triangle_distances(points, triangles)
    # All points of a triangle on a fine grid of barycentric coordinates.
    a, b = np.meshgrid(np.linspace(0.0, 1.0, 150), np.linspace(0.0, 1.0, 150))
    inside = a + b <= 1.0
    weights = np.stack([a[inside], b[inside], 1.0 - a[inside] - b[inside]], axis=1)
    for point, triangle, distance in zip(points, triangles, found, strict=True):
        nearest = np.linalg.norm(weights @ triangle - point, axis=1).min()
        assert nearest - 0.03 <= distance <= nearest + 1e-9
