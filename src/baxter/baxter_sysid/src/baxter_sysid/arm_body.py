# SPDX-License-Identifier: BSD-3-Clause
"""The rigid body of one arm: torque that balances it, and how torques move it. Free of ROS and of the physics engine.

Formulas: recursive Newton-Euler; the inertia by columns of it (R. Featherstone, Rigid Body Dynamics Algorithms, 2008,
sections 5.3 and 6.1).
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baxter_model import joint_names
from bullet_sim.damping import largest_stable
from disk_cache.compiled import compiler
from urdf_model import Inertial, Robot, merge_fixed
from urdf_model.merge import MergedRobot, combine

from .errors import SysidError

Array = NDArray[np.float64]
_compiled = compiler("baxter_sysid", [__file__], error_model="numpy")

GRAVITY = 9.81  # [m/s^2]
TICK_S = 0.002  # of the simulator, and of a replay


class ArmBody(NamedTuple):
    """Arrays of an arm of n joints about their z axes, base to tip.

    rotations (n, 3, 3), offsets (n, 3) [m]: of a joint's frame in that of the joint before, at zero; masses (n,) [kg],
    centres (n, 3) [m] and inertias (n, 3, 3) [kg m^2] about the centres, of the links in the frames of their joints;
    damping (n,) [Nm s/rad]; up (3,): the vertical in the frame before the first joint.
    """

    rotations: Array
    offsets: Array
    masses: Array
    centres: Array
    inertias: Array
    damping: Array
    up: Array


def arm_body(robot: Robot, side: str) -> ArmBody:
    """The body of one arm of a Baxter, with what is on its hand; fingers count as closed. Its damping is that of the
    simulator, which bounds it where its ticks are too long. Raises SysidError for a description without the arm."""
    merged = merge_fixed(robot)
    try:
        joints = [merged.joints[name] for name in joint_names(side)]
    except KeyError as error:
        raise SysidError("the description has no joint %s; it must be Baxter's" % error) from None
    if any(not np.allclose(joint.axis, [0.0, 0.0, 1.0]) for joint in joints):
        raise SysidError("the description's arm joints do not turn about z; it must be Baxter's")
    links = [merged.links[joint.child].inertial for joint in joints]
    links[-1] = combine([(link.mass, place[:3, :3] @ link.centre + place[:3, 3],
                          place[:3, :3] @ link.inertia @ place[:3, :3].T)
                         for link, place in _behind(merged, joints[-1].child, np.eye(4))])
    body = ArmBody(np.array([joint.origin[:3, :3] for joint in joints]),
                   np.array([joint.origin[:3, 3] for joint in joints]),
                   np.array([link.mass for link in links]), np.array([link.centre for link in links]),
                   np.array([link.inertia for link in links]),
                   np.array([joint.damping for joint in joints], dtype=float), np.array([0.0, 0.0, 1.0]))
    felt = 1.0 / np.diagonal(np.linalg.inv(inertia_matrix(body, np.zeros(len(joints)))))
    return body._replace(damping=np.minimum(body.damping, largest_stable(felt, TICK_S)))


def _behind(merged: MergedRobot, link: str, place: Array) -> list[tuple[Inertial, Array]]:
    """(inertial, place (4, 4)) of a link, and of all behind its joints, which are at zero."""
    found = [] if merged.links[link].inertial is None else [(merged.links[link].inertial, place)]
    for joint in merged.joints.values():
        if joint.parent == link:
            found += _behind(merged, joint.child, place @ joint.origin)
    return found


def hand_in_last(robot: Robot, side: str) -> Array:
    """(4, 4) the frame `<side>_hand` in that of the arm's last joint."""
    return merge_fixed(robot).frames["%s_hand" % side].offset


def with_load(body: ArmBody, mass: float, place: Array) -> ArmBody:
    """The same arm with a point mass [kg] at `place` (3,) [m] in the frame of its last joint."""
    if mass == 0.0:
        return body
    whole = combine([(body.masses[-1], body.centres[-1], body.inertias[-1]), (mass, place, np.zeros((3, 3)))])
    masses, centres, inertias = body.masses.copy(), body.centres.copy(), body.inertias.copy()
    masses[-1], centres[-1], inertias[-1] = whole.mass, whole.centre, whole.inertia
    return body._replace(masses=masses, centres=centres, inertias=inertias)


@_compiled
def turn_joints(body: ArmBody, position: Array, turned: Array) -> None:
    """Fill turned (n, 3, 3): from a joint's frame to that of the joint before, at position (n,) [rad]."""
    for i in range(len(position)):
        c, s = np.cos(position[i]), np.sin(position[i])
        for row in range(3):
            x, y = body.rotations[i, row, 0], body.rotations[i, row, 1]
            turned[i, row, 0] = x * c + y * s
            turned[i, row, 1] = y * c - x * s
            turned[i, row, 2] = body.rotations[i, row, 2]


@_compiled
def torques(body: ArmBody, turned: Array, velocity: Array, acceleration: Array, gravity: float, work: Array,
            found: Array) -> None:
    """Fill found (n,) [Nm]: what the joints exert.

    turned: of `turn_joints`; velocity, acceleration: (n,); gravity [m/s^2]; work: (n, 6), for what is in between.
    """
    ox, oy, oz, ax, ay, az = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0  # angular velocity and acceleration of the link
    lx, ly, lz = gravity * body.up[0], gravity * body.up[1], gravity * body.up[2]  # acceleration of its origin
    for i in range(len(velocity)):
        t, p, c, j, m = turned[i], body.offsets[i], body.centres[i], body.inertias[i], body.masses[i]
        # The origin of the next joint: a + alpha x p + omega x (omega x p).
        w = ox * p[0] + oy * p[1] + oz * p[2]
        w2 = ox * ox + oy * oy + oz * oz
        x = lx + ay * p[2] - az * p[1] + ox * w - p[0] * w2
        y = ly + az * p[0] - ax * p[2] + oy * w - p[1] * w2
        z = lz + ax * p[1] - ay * p[0] + oz * w - p[2] * w2
        lx, ly, lz = (t[0, 0] * x + t[1, 0] * y + t[2, 0] * z, t[0, 1] * x + t[1, 1] * y + t[2, 1] * z,
                      t[0, 2] * x + t[1, 2] * y + t[2, 2] * z)
        ox, oy, oz = (t[0, 0] * ox + t[1, 0] * oy + t[2, 0] * oz, t[0, 1] * ox + t[1, 1] * oy + t[2, 1] * oz,
                      t[0, 2] * ox + t[1, 2] * oy + t[2, 2] * oz)
        ax, ay, az = (t[0, 0] * ax + t[1, 0] * ay + t[2, 0] * az, t[0, 1] * ax + t[1, 1] * ay + t[2, 1] * az,
                      t[0, 2] * ax + t[1, 2] * ay + t[2, 2] * az)
        ax, ay, az = ax + oy * velocity[i], ay - ox * velocity[i], az + acceleration[i]
        oz += velocity[i]
        w = ox * c[0] + oy * c[1] + oz * c[2]
        w2 = ox * ox + oy * oy + oz * oz
        fx = m * (lx + ay * c[2] - az * c[1] + ox * w - c[0] * w2)
        fy = m * (ly + az * c[0] - ax * c[2] + oy * w - c[1] * w2)
        fz = m * (lz + ax * c[1] - ay * c[0] + oz * w - c[2] * w2)
        hx = j[0, 0] * ox + j[0, 1] * oy + j[0, 2] * oz
        hy = j[1, 0] * ox + j[1, 1] * oy + j[1, 2] * oz
        hz = j[2, 0] * ox + j[2, 1] * oy + j[2, 2] * oz
        work[i, 0], work[i, 1], work[i, 2] = fx, fy, fz
        work[i, 3] = j[0, 0] * ax + j[0, 1] * ay + j[0, 2] * az + oy * hz - oz * hy + c[1] * fz - c[2] * fy
        work[i, 4] = j[1, 0] * ax + j[1, 1] * ay + j[1, 2] * az + oz * hx - ox * hz + c[2] * fx - c[0] * fz
        work[i, 5] = j[2, 0] * ax + j[2, 1] * ay + j[2, 2] * az + ox * hy - oy * hx + c[0] * fy - c[1] * fx
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(velocity) - 1, -1, -1):
        t, p = turned[i], body.offsets[i]
        x, y, z = fx + work[i, 0], fy + work[i, 1], fz + work[i, 2]
        u, v, w = mx + work[i, 3], my + work[i, 4], mz + work[i, 5]
        found[i] = w
        fx, fy, fz = (t[0, 0] * x + t[0, 1] * y + t[0, 2] * z, t[1, 0] * x + t[1, 1] * y + t[1, 2] * z,
                      t[2, 0] * x + t[2, 1] * y + t[2, 2] * z)
        mx = t[0, 0] * u + t[0, 1] * v + t[0, 2] * w + p[1] * fz - p[2] * fy
        my = t[1, 0] * u + t[1, 1] * v + t[1, 2] * w + p[2] * fx - p[0] * fz
        mz = t[2, 0] * u + t[2, 1] * v + t[2, 2] * w + p[0] * fy - p[1] * fx


@_compiled
def fill_inertia(body: ArmBody, turned: Array, still: Array, unit: Array, work: Array, matrix: Array) -> None:
    """Fill matrix (n, n) [kg m^2], the joint-space inertia; still, unit: (n,) zeros."""
    for i in range(len(still)):
        unit[i] = 1.0
        torques(body, turned, still, unit, 0.0, work, matrix[i])
        unit[i] = 0.0


@_compiled
def solve(matrix: Array, right: Array, factor: Array) -> None:
    """Solve matrix (n, n), positive definite, times x = right (n,), in place of right; factor: (n, n), Cholesky's."""
    count = len(right)
    for i in range(count):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(total) if i == j else total / factor[j, j]
    for i in range(count):
        for k in range(i):
            right[i] -= factor[i, k] * right[k]
        right[i] /= factor[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= factor[k, i] * right[k]
        right[i] /= factor[i, i]


def inertia_matrix(body: ArmBody, position: Array) -> Array:
    """(n, n) [kg m^2] the joint-space inertia at position (n,) [rad]."""
    count = len(position)
    turned, matrix = np.empty((count, 3, 3)), np.empty((count, count))
    turn_joints(body, position, turned)
    fill_inertia(body, turned, np.zeros(count), np.zeros(count), np.empty((count, 6)), matrix)
    return matrix


def holding_torques(body: ArmBody, position: Array) -> Array:
    """(n,) [Nm] that balance the arm's weight at position (n,) [rad]."""
    count = len(position)
    turned, still, found = np.empty((count, 3, 3)), np.zeros(count), np.empty(count)
    turn_joints(body, position, turned)
    torques(body, turned, still, still, GRAVITY, np.empty((count, 6)), found)
    return found
