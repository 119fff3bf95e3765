# SPDX-License-Identifier: BSD-3-Clause
"""Reference inverse kinematics: slow, thorough, independent of the product's code. It runs hundreds of starts at once
in numpy.

Joints are rotated by Rodrigues' formula, directly from the URDF. A pose that no start reaches counts as out of reach
within the given limits.
"""
import numpy as np

# A start has arrived when its error, see Oracle, is below this [m].
ARRIVED = 1e-5
# If the best start stays farther from the pose than this [m], the pose is out of reach; more iterations would not help.
MISSED = 1e-3
_ITERATIONS = 120
# A start ends with the first iteration that reduces the squared error by less than this share.
_GAIN = 1e-7


class Oracle:
    """Solves for the tip of an arm. The error of a pose is sqrt(translation^2 + (metres_per_radian * angle)^2) [m].

    names: the n moving joints, base to tip; lower, upper: (n,) their limits.
    """

    def __init__(self, robot, base, tip, metres_per_radian, starts=300):
        self.starts, self._weight = starts, metres_per_radian
        self._joints, pending = [], np.eye(4)
        for joint in robot.chain(base, tip):
            pending = pending @ joint.origin
            if joint.type != "fixed":
                axis = np.asarray(joint.axis) / np.linalg.norm(joint.axis)
                self._joints.append((pending[:3, :3], pending[:3, 3], axis, joint))
                pending = np.eye(4)
        self._tip = pending
        assert all(joint.type == "revolute" for *_, joint in self._joints), "the oracle handles revolute joints only"
        self.names = [joint.name for *_, joint in self._joints]
        self.lower = np.array([joint.limit.lower for *_, joint in self._joints])
        self.upper = np.array([joint.limit.upper for *_, joint in self._joints])

    def place(self, q):
        """Return the tip's rotations (m, 3, 3), positions (m, 3) and Jacobians (m, 6, n) for postures (m, n)."""
        turn, point = np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3))
        axes, origins = [], []
        for k, (rotation, offset, axis, _) in enumerate(self._joints):
            point = point + turn @ offset
            turn = turn @ rotation
            axes.append(turn @ axis)
            origins.append(point)
            turn = turn @ _rodrigues(axis, q[:, k])
        position = point + turn @ self._tip[:3, 3]
        jacobian = np.concatenate([np.stack([np.cross(axis, position - origin) for axis, origin in
                                             zip(axes, origins, strict=True)], axis=2), np.stack(axes, axis=2)], axis=1)
        return turn @ self._tip[:3, :3], position, jacobian

    def fk(self, q):
        """Return the tip's pose (4, 4) for one posture (n,)."""
        pose = np.eye(4)
        rotations, positions, _ = self.place(np.asarray(q)[None])
        pose[:3, :3], pose[:3, 3] = rotations[0], positions[0]
        return pose

    def solutions(self, target, rng, lower=None, upper=None, enough=None):
        """Return (postures (k, n) that reach ``target`` (4, 4), least error [m] of all starts).

        ``lower``, ``upper``: limits that replace the arm's. ``enough``: stop after this many postures.
        """
        q, error = self._descend(target, rng, lower, upper, enough)
        return q[error < ARRIVED], error.min()

    def reaches(self, target, rng, lower=None, upper=None):
        """Return whether a posture within the limits reaches the target; None if the closest one is too close to
        decide."""
        found, least = self.solutions(target, rng, lower, upper, enough=1)
        return True if len(found) else False if least > MISSED else None

    def nearest(self, target, rng, position_only=False, lower=None, upper=None):
        """Return the least error [m] of the tip's pose relative to ``target``, see :meth:`solutions`."""
        return self._descend(target, rng, lower, upper, rows=3 if position_only else 6)[1].min()

    def widened(self, excess):
        """Return (lower, upper) with the limits of the joints in ``excess`` {joint: [rad]} widened on both sides."""
        by = np.array([excess.get(name, 0.0) for name in self.names])
        return self.lower - by, self.upper + by

    def _descend(self, target, rng, lower=None, upper=None, enough=None, rows=6):
        """Levenberg-Marquardt from random starts, each with its own damping; (postures (m, n), errors (m,))."""
        lower = self.lower if lower is None else lower
        upper = self.upper if upper is None else upper
        q = rng.uniform(np.maximum(lower, -np.pi), np.minimum(upper, np.pi), (self.starts, len(self.names)))
        damping, active = np.full(len(q), 1e-2), np.arange(len(q))
        error, jacobian = self._error(target, q, rows)
        cost = np.sum(error ** 2, axis=1)
        for _ in range(_ITERATIONS):
            j, e, here = jacobian[active], error[active], q[active]
            slope = np.einsum("mij,mi->mj", j, e)
            stuck = ((here <= lower) & (slope < 0.0)) | ((here >= upper) & (slope > 0.0))
            j = np.where(stuck[:, None, :], 0.0, j)
            normal = np.einsum("mij,mik->mjk", j, j) + damping[active, None, None] * np.eye(q.shape[1])
            step = np.linalg.solve(normal, np.where(stuck, 0.0, slope)[..., None])[..., 0]
            tried = np.clip(here + step, lower, upper)
            new_error, new_jacobian = self._error(target, tried, rows)
            new_cost = np.sum(new_error ** 2, axis=1)
            better = new_cost < cost[active]
            gained = cost[active] - new_cost
            moved = active[better]
            q[moved], error[moved], jacobian[moved] = tried[better], new_error[better], new_jacobian[better]
            cost[moved] = new_cost[better]
            damping[active] = np.where(better, np.maximum(0.2 * damping[active], 1e-9), 5.0 * damping[active])
            over = (better & (gained < _GAIN * new_cost)) | (damping[active] > 1e4)
            active = active[~over & (cost[active] > 0.01 * ARRIVED ** 2)]
            if not len(active) or (enough is not None and np.sum(cost < ARRIVED ** 2) >= enough):
                break
        return q, np.sqrt(cost)

    def _error(self, target, q, rows):
        """Weighted pose error (m, rows), and the Jacobian that goes with it."""
        rotations, positions, jacobian = self.place(q)
        error = np.empty((len(q), 6))
        error[:, :3] = target[:3, 3] - positions
        m = target[:3, :3] @ np.swapaxes(rotations, 1, 2)
        twice = np.stack((m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]), axis=1)
        sine = np.linalg.norm(twice, axis=1)
        angle = np.arctan2(sine, np.trace(m, axis1=1, axis2=2) - 1.0)
        scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 0.5)
        error[:, 3:] = self._weight * scale[:, None] * twice
        return error[:, :rows], jacobian[:, :rows] * np.array([1.0] * 3 + [self._weight] * 3)[None, :rows, None]


def _rodrigues(axis, angles):
    """Return the rotations (m, 3, 3) about ``axis`` (3,) by ``angles`` (m,)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angles)[:, None, None] * cross + (1.0 - np.cos(angles))[:, None, None] * (cross @ cross)
