# SPDX-License-Identifier: BSD-3-Clause
"""Vectors and small symmetric matrices: at most seven by seven. Own code, because numba's ``numpy.linalg`` needs
scipy."""
from __future__ import annotations

import math

import numpy as np

from arm_kinematics.kernels.compiled import compiled

# A pivot below this (the matrices are of order 1) means a singular direction.
_SINGULAR = 1e-14


@compiled
def length(vector: np.ndarray, start: int, stop: int) -> float:
    """Return the length of the part ``start`` to ``stop`` - 1 of a vector."""
    total = 0.0
    for i in range(start, stop):
        total += vector[i] * vector[i]
    return math.sqrt(total)


@compiled
def distance(a: np.ndarray, b: np.ndarray) -> float:
    """Return the distance of two postures (n,)."""
    total = 0.0
    for i in range(a.shape[0]):
        total += (a[i] - b[i]) ** 2
    return math.sqrt(total)


@compiled
def factorise(matrix: np.ndarray, size: int) -> None:
    """Cholesky factor in place (lower triangle), the inverse of each pivot on the diagonal.

    A singular direction gets 0 there, so it does not move.
    """
    for j in range(size):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        inverse = 1.0 / math.sqrt(pivot) if pivot > _SINGULAR else 0.0
        matrix[j, j] = inverse
        for i in range(j + 1, size):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value * inverse


@compiled
def back_substitute(factor: np.ndarray, size: int, vector: np.ndarray) -> None:
    """Solve in place with the factor of :func:`factorise`."""
    for i in range(size):
        value = vector[i]
        for k in range(i):
            value -= factor[i, k] * vector[k]
        vector[i] = value * factor[i, i]
    for i in range(size - 1, -1, -1):
        value = vector[i]
        for k in range(i + 1, size):
            value -= factor[k, i] * vector[k]
        vector[i] = value * factor[i, i]


@compiled
def damp(jacobian: np.ndarray, rows: int, damping: float, normal: np.ndarray, step: np.ndarray) -> None:
    """Turn ``step`` (n,), the slope J^T e on entry, into (J^T J + damping I)^-1 J^T e; ``normal`` (n, n) is work
    space."""
    n = step.shape[0]
    for i in range(n):
        for j in range(i + 1):
            value = 0.0
            for row in range(rows):
                value += jacobian[row, i] * jacobian[row, j]
            normal[i, j] = value
        normal[i, i] += damping
    factorise(normal, n)
    back_substitute(normal, n, step)


@compiled
def fill_gram(jacobian: np.ndarray, rows: int, damping: float, gram: np.ndarray) -> None:
    """Fill the lower triangle of ``gram`` with J J^T + damping I, of the first ``rows`` of J."""
    for row in range(rows):
        for column in range(row + 1):
            value = 0.0
            for i in range(jacobian.shape[1]):
                value += jacobian[row, i] * jacobian[column, i]
            gram[row, column] = value
        gram[row, row] += damping


@compiled
def wrench(jacobian: np.ndarray, torques: np.ndarray, damping: float) -> np.ndarray:
    """Damped least-squares wrench (6,) whose joint torques are ``torques``: (J J^T + damping^2) w = J torques."""
    n = torques.shape[0]
    gram, result = np.empty((6, 6)), np.empty(6)
    for row in range(6):
        result[row] = 0.0
        for i in range(n):
            result[row] += jacobian[row, i] * torques[i]
    fill_gram(jacobian, 6, damping * damping, gram)
    factorise(gram, 6)
    back_substitute(gram, 6, result)
    return result
