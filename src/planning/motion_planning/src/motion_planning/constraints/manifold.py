# SPDX-License-Identifier: BSD-3-Clause
"""Projection of postures onto constraints by Newton's method."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from motion_planning.constraints import regions
from motion_planning.kinematics import KinematicsFailure, limbs_of
from urdf_model import Box, Cylinder, Sphere
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from arm_kinematics import Chain
    from motion_planning.constraints import ConstraintSet
    from motion_planning.constraints.regions import Volume
    from motion_planning.model import Group, PlanningModel
    from motion_planning.scene import Scene

# Postures are projected to where they keep a margin for the motion between two of them: this share of a tolerance or
# half size, at most so much [m; rad], so that a large region may be used up to its edge.
_SHARE, _MARGIN_M, _MARGIN_RAD = 0.2, 0.005, 0.01
_STEPS = 25
# Damping of Newton's steps, and greatest motion of a joint in one step [rad or m].
_DAMPING, _LONGEST = 1e-4, 0.5
# Smaller residuals count as zero [rad or m].
_NONE = 1e-10
_MIN_COSINE = 0.05


class Manifold:
    """The postures (k,) of a group that satisfy joint, position and orientation constraints.

    bounds (k, 2): of the joints, including the joint constraints. Constraints on links that the group does not move
    alone, and lines of sight, are not checked here.
    """

    def __init__(self, scene: Scene, group: Group, constraints: ConstraintSet, near: np.ndarray) -> None:
        """group: Group; constraints: ConstraintSet. near (k,): continuous joints stay within half a turn of it. Raises
        ConstraintError for unknown names."""
        model, constraints = scene.model, constraints.resolved(scene)
        self.bounds = _bounds(model, group, constraints, near)
        frames = model.frames(scene.state.q, scene.state.base)
        self._parts = []
        for kind, targets in ((_Place, constraints.positions), (_Turn, constraints.orientations)):
            for target in targets:
                try:
                    limb = limbs_of(model, group, [target.link])[0]
                except KinematicsFailure:
                    continue
                columns = np.searchsorted(group.indices, limb.indices)
                self._parts.append(kind(target, limb.chain, columns, frames[model.link_index[limb.base]]))

    def keeps(self, q: np.ndarray) -> bool:
        """Whether the posture ``q`` (k,) satisfies the constraints, with their full tolerances."""
        return bool((q >= self.bounds[:, 0] - _NONE).all() and (q <= self.bounds[:, 1] + _NONE).all()
                    and not any(np.any(part.residual(q, margin=False)[0]) for part in self._parts))

    def project(self, q: np.ndarray) -> np.ndarray | None:
        """Return a posture (k,) near ``q`` that satisfies the constraints with some margin, None if none is found."""
        q = np.clip(q, self.bounds[:, 0], self.bounds[:, 1])
        if not self._parts:
            return q
        for _ in range(_STEPS):
            residual, jacobian = self._residual(q)
            if np.abs(residual).max() <= _NONE:
                return q
            # Joints at a limit that would move beyond it are left out.
            free = np.ones(len(q), dtype=bool)
            for _ in range(2):
                part = jacobian[:, free]
                step = np.zeros(len(q))
                step[free] = -part.T @ np.linalg.solve(part @ part.T + _DAMPING * np.eye(len(part)), residual)
                inside = ((q > self.bounds[:, 0]) | (step > 0.0)) & ((q < self.bounds[:, 1]) | (step < 0.0))
                if (inside | ~free).all():
                    break
                free &= inside
            most = np.abs(step).max()
            q = np.clip(q + step * min(1.0, _LONGEST / max(most, _NONE)), self.bounds[:, 0], self.bounds[:, 1])
            if most < _NONE:
                return None
        return None

    def _residual(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = [part.residual(q, margin=True) for part in self._parts]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


class _Part:
    """One constraint on a link: the error beyond its tolerance, and its derivatives with respect to the joints."""

    def __init__(self, target: Any, chain: Chain, columns: np.ndarray, root: np.ndarray) -> None:
        self._target, self._chain, self._columns, self._root = target, chain, columns, root

    def residual(self, q: np.ndarray, margin: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return (residual (3,), its derivatives (3, k)); 0 within the tolerance, less a margin if ``margin``."""
        pose, jacobian = self._chain.fk_and_jacobian(q[self._columns])
        turn = self._root[:3, :3]
        whole = np.zeros((6, len(q)))
        whole[:3, self._columns], whole[3:, self._columns] = turn @ jacobian[:3], turn @ jacobian[3:]
        residual, derivatives = self._beyond(self._root @ pose, whole, margin)
        # Errors within the tolerance count as zero.
        derivatives[residual == 0.0] = 0.0
        return residual, derivatives

    def _beyond(self, pose: np.ndarray, jacobian: np.ndarray, margin: bool) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError


class _Turn(_Part):
    def _beyond(self, pose: np.ndarray, jacobian: np.ndarray, margin: bool) -> tuple[np.ndarray, np.ndarray]:
        wanted = self._target.rotation
        angles = np.asarray(self._target.angles(wanted.T @ pose[:3, :3] @ self._target.axes))
        tolerances = np.array(self._target.tolerances)
        tolerances = np.where(tolerances >= math.pi, np.inf, _inner(tolerances, _MARGIN_RAD * margin))
        rates = _of_rotation_vector(angles) if self._target.rotation_vector else _of_angles(angles)
        return angles - np.clip(angles, -tolerances, tolerances), rates @ wanted.T @ jacobian[3:]


class _Place(_Part):
    def _beyond(self, pose: np.ndarray, jacobian: np.ndarray, margin: bool) -> tuple[np.ndarray, np.ndarray]:
        lever = pose[:3, :3] @ self._target.offset
        point = pose[:3, 3] + lever
        found = []
        for shape, place in self._target.regions:
            beyond = _beyond_shape(shape, inverse(place)[:3] @ np.append(point, 1.0), _MARGIN_M * margin)
            found.append((float(np.linalg.norm(beyond)), beyond, place))
        _, beyond, place = min(found, key=lambda one: one[0])
        x, y, z = lever
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return beyond, place[:3, :3].T @ (jacobian[:3] - cross @ jacobian[3:])


def _inner(size: Any, margin: float) -> Any:
    """A half size or tolerance without its margin."""
    return size - _margin(size, margin)


def _margin(size: Any, most: float) -> Any:
    return np.minimum(_SHARE * size, most)


def _beyond_shape(shape: Volume, point: np.ndarray, margin: float) -> np.ndarray:
    """The vector (3,) from a shape, smaller by ``margin`` [m] all round, to a point (3,) in its frame; 0 within."""
    if isinstance(shape, Box):
        half = _inner(0.5 * np.asarray(shape.size), margin)
        return point - np.clip(point, -half, half)
    if isinstance(shape, Sphere):
        length = float(np.linalg.norm(point))
        return point * max(0.0, 1.0 - _inner(shape.radius, margin) / length) if length > 0.0 else np.zeros(3)
    if isinstance(shape, Cylinder):
        out = math.hypot(point[0], point[1])
        half = _inner(0.5 * shape.length, margin)
        sideways = point[:2] * (max(0.0, 1.0 - _inner(shape.radius, margin) / out) if out > 0.0 else 0.0)
        return np.array([*sideways, point[2] - min(max(point[2], -half), half)])
    # Cones and hulls of meshes: out of the plane that the point is farthest beyond.
    normals, offsets, depths = regions.planes_of(shape, point)
    beyond = normals @ point - offsets + _margin(depths, margin)
    worst = int(beyond.argmax())
    return normals[worst] * max(0.0, float(beyond[worst]))


def _of_angles(angles: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) from an angular velocity in the fixed frame to the rates of angles about x, then the new
    y, then the new z."""
    sine_x, cosine_x = math.sin(angles[0]), math.cos(angles[0])
    sine_y, cosine_y = math.sin(angles[1]), math.cos(angles[1])
    cosine_y = math.copysign(max(abs(cosine_y), _MIN_COSINE), cosine_y)
    about_z = np.array([0.0, -sine_x / cosine_y, cosine_x / cosine_y])
    return np.array([np.array([1.0, 0.0, 0.0]) - sine_y * about_z, [0.0, cosine_x, sine_x], about_z])


def _of_rotation_vector(vector: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) from an angular velocity in the fixed frame to the rate of a rotation vector."""
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = float(np.linalg.norm(vector))
    if angle < 1e-4:
        factor = 1.0 / 12.0
    else:
        half = 0.5 * min(angle, math.pi - 1e-6)
        factor = (1.0 - half / math.tan(half)) / angle**2
    return np.eye(3) - 0.5 * cross + factor * cross @ cross


def _bounds(model: PlanningModel, group: Group, constraints: ConstraintSet, near: np.ndarray) -> np.ndarray:
    """Bounds (k, 2) of the joints, including joint constraints; continuous joints get one turn around ``near``."""
    bounds = np.array(model.bounds[group.indices])
    turns = model.continuous[group.indices]
    bounds[turns] = np.column_stack([near - math.pi, near + math.pi])[turns]
    for one in constraints.joints:
        at = np.flatnonzero(group.indices == model.index[one.joint])
        if len(at):
            position = one.position
            if turns[at[0]]:
                position += 2.0 * math.pi * round((near[at[0]] - position) / (2.0 * math.pi))
            low, high = bounds[at[0]]
            bounds[at[0]] = max(low, position - one.below), min(high, position + one.above)
            if bounds[at[0], 0] > bounds[at[0], 1]:
                bounds[at[0]] = np.clip(position, low, high)
    return bounds
