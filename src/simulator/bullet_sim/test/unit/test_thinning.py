# SPDX-License-Identifier: BSD-3-Clause
"""Meshes with fewer triangles: what they keep of their shape."""
import numpy as np
import pytest

from bullet_sim.thinning import outermost, thin_out
from lab_testing.meshes import sphere


@pytest.mark.parametrize("rings, target", [(60, 1000), (60, 12000), (180, 12000), (180, 1000)])
def test_thinning_out_keeps_the_shape_and_the_outside(rings, target):
    vertices, faces = sphere(rings)
    thin_vertices, thin_faces = thin_out(vertices, faces, target)
    assert 0.6 * target < len(thin_faces) <= target  # the finest grid that will do
    corners = thin_vertices[thin_faces]
    assert np.abs(np.linalg.norm(thin_vertices[np.unique(thin_faces)], axis=1) - 1.0).max() < 0.1
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = (normals * corners.mean(axis=1)).sum(axis=1)
    assert (outward > 0.0).mean() > 0.98


def test_a_small_mesh_is_left_as_it_is():
    vertices, faces = sphere(5)
    assert thin_out(vertices, faces, 1000)[1] is faces


def test_triangles_that_have_become_the_same_one_count_once_and_both_sides_of_a_wall_stay():
    near, far = np.eye(3), np.eye(3) + 1e-4
    corner = [[5.0, 5.0, 5.0]]
    vertices = np.concatenate([near, far, corner])
    # The same triangle, begun at another corner; and one that faces the other way.
    vertices, faces = thin_out(vertices, np.array([[0, 1, 2], [4, 5, 3], [2, 1, 0], [6, 6, 0]]), 3)
    assert len(faces) == 2
    a, b = (np.cross(*np.diff(vertices[face], axis=0)) for face in faces)
    np.testing.assert_allclose(a, -b)


def test_outermost_vertices_have_the_same_hull():
    vertices = np.random.default_rng(1).uniform(-1.0, 1.0, size=(200_000, 3))
    kept = outermost(vertices, 16)
    assert len(kept) <= 17**3
    np.testing.assert_allclose(np.abs(kept).max(axis=0), 1.0, atol=0.01)
