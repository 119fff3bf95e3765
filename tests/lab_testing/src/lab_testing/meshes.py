# SPDX-License-Identifier: BSD-3-Clause
"""Meshes with known measures."""
import numpy as np


def sphere(rings):
    """Vertices (n, 3) and outward triangles (m, 3) of a unit sphere with this many rings between its poles."""
    angles = np.linspace(0.0, np.pi, rings + 1)
    turns = np.linspace(0.0, 2.0 * np.pi, 2 * rings + 1)
    grid = np.array([[np.sin(a) * np.cos(t), np.sin(a) * np.sin(t), np.cos(a)] for a in angles for t in turns])
    width = len(turns)
    faces = [f for i in range(rings) for j in range(width - 1)
             for f in ((i * width + j, (i + 1) * width + j, (i + 1) * width + j + 1),
                       (i * width + j, (i + 1) * width + j + 1, i * width + j + 1))]
    return grid, np.array(faces)
