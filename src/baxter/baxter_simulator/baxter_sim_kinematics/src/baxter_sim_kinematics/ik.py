# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics: from a pose of the tip to joint values inside the limits, or to the reason why there are none."""
import math
from dataclasses import dataclass

import numpy as np

from baxter_sim_kinematics import kernels
from baxter_sim_kinematics.errors import InvalidTarget, NoSolution, Reason

# Random starts before a pose counts as unreachable. Of 100,000 random reachable Baxter poses none needed more than 100.
MAX_STARTS = 200
# Iterations of one start. Most arrive within 15; one that makes no progress is left earlier.
MAX_ITERATIONS = 100
# Off by less than this a rotation is taken for a rounded one and normalised (the labs' quaternion is off by 9e-4).
ROUNDED = 1e-2
# A pose error that stays above this with limits lifted is no matter of more iterations [m or rad].
_CLEARLY_OFF = 1e-4
# Starts for finding out why: the questions are easier than the search was.
_STARTS_TO_EXPLAIN = 40


@dataclass(frozen=True)
class IkResult:
    """A solution. q: joint values (n,) in chain order, inside the limits. residual_m, residual_rad: what is left of the
    pose error. iterations, restarts: the effort, of all starts together."""

    q: np.ndarray
    residual_m: float
    residual_rad: float
    iterations: int
    restarts: int


def pose_from_quaternion(position, quaternion_xyzw):
    """Return the pose (4, 4) at ``position`` (x, y, z) [m] with orientation (x, y, z, w).

    A quaternion whose length is off by less than 0.01 is normalised. Raises InvalidTarget for any other length and for
    numbers that are not finite.
    """
    numbers = [float(number) for number in (*position, *quaternion_xyzw)]
    if len(numbers) != 7 or not all(map(math.isfinite, numbers)):
        raise InvalidTarget("position and orientation must be seven finite numbers, got position %s and quaternion "
                            "(x y z w) %s" % (numbers[:3], numbers[3:]), numbers)
    length = math.sqrt(sum(number * number for number in numbers[3:]))
    if abs(length - 1.0) > ROUNDED:
        hint = "; the identity is 0 0 0 1" if length == 0.0 else ""
        raise InvalidTarget("quaternion (x y z w) %s has length %.6g, a rotation needs length 1%s"
                            % (numbers[3:], length, hint), numbers)
    x, y, z, w = (number / length for number in numbers[3:])
    return np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w), numbers[0]],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w), numbers[1]],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y), numbers[2]],
        [0.0, 0.0, 0.0, 1.0],
    ])


def solve(chain, target, seed, tolerance_m=1e-6, tolerance_rad=1e-6, position_only=False, candidates=2,
          max_starts=MAX_STARTS, max_iterations=MAX_ITERATIONS):
    """Return an :class:`IkResult` whose q puts the tip of ``chain`` on ``target`` (4, 4), tip in base [m].

    Damped least squares, started at ``seed`` (n,) and then at random postures until ``candidates`` of the starts have
    arrived. Where the arm has more joints than the pose needs, each solution is then moved along its self-motion to the
    point nearest the seed (least squares over the joints); the nearest of all is returned. Two candidates cost about
    0.06 ms on a 7-joint arm and are the nearest there is three times out of four, 32 cost 1 ms and miss 1 in 100.

    Joint limits are never broken; a seed outside of them is clamped. The random postures are seeded by the request
    itself: the same request gives the same answer bit for bit. With ``position_only`` any orientation will do.

    Raises NoSolution, which says why; InvalidTarget; InvalidPosture for a seed that does not fit the chain.
    """
    rotation, position = _checked_target(target)
    lower, upper = chain.limit_arrays
    seed = chain.posture(seed)
    if not (tolerance_m > 0.0 and tolerance_rad > 0.0 and candidates >= 1 and max_starts >= 1 and max_iterations >= 1):
        raise ValueError("tolerances must be positive and candidates, max_starts, max_iterations at least 1")
    search = _Search(chain, rotation, position, float(tolerance_m), float(tolerance_rad))
    beyond_reach = _beyond_reach(chain, rotation, position, position_only)
    if beyond_reach:
        max_starts = 1
    found = search.run(seed, lower, upper, position_only, candidates, max_starts, max_iterations)
    if found.arrived == 0:
        if beyond_reach:
            raise search.failure(found, Reason.OUT_OF_REACH, beyond_reach)
        found = _second_chance(search, found, seed, position_only, max_starts, max_iterations)
    return IkResult(found.q, found.residual_m, found.residual_rad, found.iterations, found.starts - 1)


def warm_up(chain):
    """Compile, or load from the cache, everything that ``chain`` and :func:`solve` need, by using it once."""
    pose, jacobian = chain.fk_and_jacobian(chain.mid_range)
    chain.link_frames(chain.mid_range)
    kernels.wrench(jacobian, chain.mid_range, 0.01)
    solve(chain, pose, chain.mid_range)


@dataclass(frozen=True)
class _Found:
    arrived: int
    starts: int
    iterations: int
    residual_m: float
    residual_rad: float
    q: np.ndarray


class _Search:
    """One target, searched for under varying limits."""

    def __init__(self, chain, rotation, position, tolerance_m, tolerance_rad):
        self.chain = chain
        self._target = (rotation, position)
        self._tolerances = (tolerance_m, tolerance_rad)

    def run(self, seed, lower, upper, position_only, candidates, max_starts, max_iterations):
        q = np.empty(len(self.chain))
        outcome = kernels.search(*self.chain.arrays, lower, upper, *self._target, seed, 3 if position_only else 6,
                                 *self._tolerances, int(max_iterations), int(max_starts), int(candidates), q)
        return _Found(*outcome, q)

    def failure(self, found, reason, detail, joints=()):
        target = np.eye(4)
        target[:3, :3], target[:3, 3] = self._target
        return NoSolution(target, reason, detail, found.residual_m, found.residual_rad, found.q, joints)


def _second_chance(search, found, seed, position_only, max_starts, max_iterations):
    """Find out why nothing arrived and raise NoSolution; return the solution where the inquiry happens to find one."""
    chain = search.chain
    lower, upper = chain.limit_arrays
    if max_starts < MAX_STARTS or max_iterations < MAX_ITERATIONS:
        if search.run(seed, lower, upper, position_only, 1, MAX_STARTS, MAX_ITERATIONS).arrived:
            raise search.failure(found, Reason.NOT_CONVERGED, "a solution exists, but not within %d starts of %d "
                                 "iterations from this seed; allow more" % (max_starts, max_iterations))
    free = np.full(len(chain), math.inf)
    lifted = search.run(found.q, -free, free, position_only, 4, _STARTS_TO_EXPLAIN, MAX_ITERATIONS)
    if lifted.arrived:
        over = _over_limits(chain, lifted.q)
        if over:
            raise search.failure(found, Reason.JOINT_LIMIT, "%s; change the orientation or bring the target nearer to "
                                 "the middle of the workspace" % ", ".join(over.values()), over)
        inside = search.run(np.clip(_wrapped(chain, lifted.q), lower, upper), lower, upper, position_only, 1, 1,
                            MAX_ITERATIONS)
        if inside.arrived:
            return inside
    elif max(lifted.residual_m, 0.0 if position_only else lifted.residual_rad) > _CLEARLY_OFF:
        if not position_only and search.run(seed, lower, upper, True, 1, _STARTS_TO_EXPLAIN, MAX_ITERATIONS).arrived:
            raise search.failure(found, Reason.OUT_OF_REACH, "the point can be reached, but not in this orientation; "
                                 "turn the target or move it into the workspace")
        raise search.failure(found, Reason.OUT_OF_REACH, "the arm ends %.3f m short even without its joint limits; "
                             "move the target into the workspace" % lifted.residual_m)
    raise search.failure(found, Reason.NOT_CONVERGED, "%d starts came close but none within the tolerance; the target "
                         "is at the edge of the workspace or near a singularity, move it a little or try another seed"
                         % found.starts)


def _checked_target(target):
    """Return the target's rotation (3, 3), made orthonormal, and position (3,) as arrays of their own."""
    try:
        matrix = np.array(target, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (4, 4):
        raise InvalidTarget("the target must be a 4 x 4 pose matrix, got %r" % (target,), target)
    rotation, position = np.empty((3, 3)), np.empty(3)
    if not kernels.split_pose(matrix, ROUNDED, rotation, position):
        raise InvalidTarget("the target must hold a finite position and a rotation, got\n%s" % matrix, target)
    return rotation, position


def _beyond_reach(chain, rotation, position, position_only):
    """Return the sentence that the target lies outside a ball which the arm cannot leave, or "" when it lies inside.

    With the orientation given, the origin of a last revolute joint is known, so there is a ball for that as well.
    """
    over = math.dist(position, chain.shoulder) - chain.tip_reach_m
    text = "the target lies at least %.3f m beyond the outstretched arm; move it"
    if over <= 0.0 and chain.wrist_is_fixed and not position_only:
        over = math.dist(position - rotation @ chain.wrist_in_tip, chain.shoulder) - chain.wrist_reach_m
        text = "in this orientation the wrist would have to be at least %.3f m beyond the outstretched arm; turn the " \
            "target or move it"
    if over <= 0.0:
        return ""
    return (text + " towards the shoulder at (%.3f %.3f %.3f) in %s") % (over, *chain.shoulder, chain.base)


def _wrapped(chain, q):
    """Turn revolute joints by whole turns to where they are inside their limits, or least outside."""
    lower, upper = chain.limit_arrays
    middle = chain.mid_range
    turns = np.round((q - middle) / (2.0 * math.pi))
    return np.where(chain.arrays[2] | ~np.isfinite(lower) | ~np.isfinite(upper), q, q - 2.0 * math.pi * turns)


def _over_limits(chain, q):
    """Return {joint name: sentence} of the joints that ``q``, taken modulo whole turns, has outside their limits."""
    over = {}
    for name, value, low, high, slides in zip(chain.joint_names, _wrapped(chain, q), *chain.limit_arrays,
                                              chain.arrays[2], strict=True):
        if not low - 1e-9 <= value <= high + 1e-9:
            side, limit = ("lower", low) if value < low else ("upper", high)
            over[name] = "%s would have to go to %.3f %s, its %s limit is %.3f" % (
                name, value, "m" if slides else "rad", side, limit)
    return over
