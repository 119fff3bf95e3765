# SPDX-License-Identifier: BSD-3-Clause
"""Poses that have no solution for a known cause, and what a correct diagnosis must say.

Each pose is built and judged with ik_oracle, which shares no code with the solver under test. bullet_sim finds
contacts.
"""
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from ik_oracle import MISSED, Oracle

from arm_kinematics import Budget, NoSolution, Reason, Target, solve
from arm_kinematics.target import METRES_PER_RADIAN
from bullet_sim import Pose
from urdf_model import parse_urdf
from urdf_model.transforms import axis_rotation, rigid

# The distance in a diagnosis may be longer than the oracle's by this share and this length [m].
_LONGER, _LONGER_M = 0.02, 1e-3
# The oracle may exceed a limit by this much more than the diagnosis says [rad]: at exactly that excess only one posture
# reaches the pose.
_ROOM = 0.02
# The pair in a diagnosis must touch in this share of the postures that reach the pose.
_OFTEN = 0.25
# The oracle must find at least this many postures that reach a pose, otherwise they do not show what is in the way.
_ENOUGH = 30
_POST = parse_urdf("""<robot name="post"><link name="box"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"
ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
</robot>""", source="post")


@dataclass(frozen=True)
class Case:
    """One pose, how to ask for it, and a function that tells whether a NoSolution about it is correct."""

    kind: str
    target: np.ndarray
    right: Callable
    budget: Budget = Budget()
    position_only: bool = False
    post: tuple | None = None  # position of a 10 cm box [m, base frame]


class Builder:
    """Builds cases for one arm. ``checker``: a BulletChecker of its robot. The same ``rng`` state gives the same
    cases."""

    def __init__(self, robot, chain, checker, rng, starts=300):
        self._chain, self._rng, self.checker = chain, rng, checker
        self._oracle = Oracle(robot, chain.base, chain.tip, METRES_PER_RADIAN, starts)
        base = np.eye(4)
        for joint in robot.chain(robot.root, chain.base):
            base = base @ joint.origin
        self._base = base
        self._kinds = {
            "beyond the links' length": self._too_far, "wrist beyond the links' length": self._wrist_too_far,
            "in no orientation like this": self._not_like_this, "a point out of reach": self._point_too_far,
            "one joint's limit": self._one_limit, "two joints' limits": self._two_limits,
            "touches itself": self._touches_itself, "touches the world": self._touches_world,
            "search cut short": self._cut_short, "tolerance too fine": self._too_fine,
        }

    def build(self, kind, count):
        """Return ``count`` cases of one of KINDS."""
        cases = []
        while len(cases) < count:
            case = self._kinds[kind](kind)
            if case is not None:
                cases.append(case)
        return cases

    def ask(self, case):
        """Return the NoSolution about a case; None if the pose has a solution after all."""
        options = {"budget": case.budget}
        if case.kind.startswith("touches"):
            options["checker"] = self.checker
        self._stand(case.post)
        try:
            solve(self._chain, Target(case.target, case.position_only), self._chain.mid_range, **options)
        except NoSolution as failure:
            return failure
        finally:
            self._stand(None)
        return None

    def right(self, case, failure):
        """Return whether the result of :meth:`ask` names the correct cause, and whether its nearest pose is correct."""
        return (failure is not None and self._inside(failure.best) and bool(case.right(failure))
                and np.allclose(self._oracle.fk(failure.best), failure.nearest, atol=1e-9))

    def _stand(self, place):
        world = self.checker.world
        if "post" in world.models:
            world.delete("post")
        if place is not None:
            position = self._base @ np.array((*place, 1.0))
            world.spawn(_POST, "post", Pose(tuple(position[:3].tolist())), static=True)

    def _inside(self, q):
        return (q >= self._oracle.lower).all() and (q <= self._oracle.upper).all()

    # -- out of reach --------------------------------------------------------------------------------------------

    def _away(self, length):
        direction = self._rng.normal(size=3)
        return self._chain.shoulder + length * direction / np.linalg.norm(direction)

    def _rotation(self):
        axis = self._rng.normal(size=3)
        return axis_rotation(axis / np.linalg.norm(axis), self._rng.uniform(0.0, np.pi))

    def _out_of_reach(self, kind, target, over, position_only=False):
        """``over``: the least distance [m] to the target that follows from the lengths alone."""
        least = self._oracle.nearest(target, self._rng, position_only)

        def right(failure):
            short = np.hypot(failure.residual_m, METRES_PER_RADIAN * failure.residual_rad * (not position_only))
            return (failure.reason is Reason.OUT_OF_REACH and failure.residual_m >= over
                    and short <= (1.0 + _LONGER) * least + _LONGER_M)

        return Case(kind, target, right, position_only=position_only)

    def _too_far(self, kind):
        """The target is farther away than the sum of the links' lengths."""
        over = self._rng.uniform(0.01, 1.0)
        return self._out_of_reach(kind, rigid(self._rotation(), self._away(self._chain.tip_reach_m + over)), over)

    def _wrist_too_far(self, kind):
        """The pose fixes a point of the last joint's axis, and that point is farther away than the sum of the links'
        lengths."""
        chain, rotation = self._chain, self._rotation()
        position = self._away(chain.tip_reach_m * self._rng.uniform(0.8, 0.99))
        wrist = position - rotation @ chain.wrist_in_tip
        if np.linalg.norm(wrist - chain.shoulder) < chain.wrist_reach_m + 0.005:
            return None
        return self._out_of_reach(kind, rigid(rotation, position), 0.0)

    def _not_like_this(self, kind):
        """The pose is out of reach even without limits, although tip and wrist are close enough."""
        chain, rotation = self._chain, self._rotation()
        position = self._away(chain.tip_reach_m * self._rng.uniform(0.6, 1.0))
        wrist = position - rotation @ chain.wrist_in_tip
        target = rigid(rotation, position)
        if np.linalg.norm(wrist - chain.shoulder) > chain.wrist_reach_m or self._unlimited(target) is not False:
            return None
        return self._out_of_reach(kind, target, 0.0)

    def _point_too_far(self, kind):
        """The point is out of reach in every orientation, with or without limits."""
        target = rigid(np.eye(3), self._away(self._chain.tip_reach_m * self._rng.uniform(0.9, 1.2)))
        free = np.full(len(self._chain), np.inf)
        if self._oracle.nearest(target, self._rng, True, -free, free) < MISSED:
            return None
        return self._out_of_reach(kind, target, 0.0, position_only=True)

    def _unlimited(self, target):
        free = np.full(len(self._chain), np.inf)
        return self._oracle.reaches(target, self._rng, -free, free)

    # -- joint limits --------------------------------------------------------------------------------------------

    def _beyond(self, joints):
        """Return (target of a posture with ``joints`` (indices) beyond their limits, {name: by how much [rad]})."""
        oracle = self._oracle
        q, excess = self._rng.uniform(oracle.lower, oracle.upper), {}
        for joint in joints:
            by = self._rng.uniform(0.03, 0.8)
            q[joint] = oracle.upper[joint] + by if self._rng.random() < 0.5 else oracle.lower[joint] - by
            excess[oracle.names[joint]] = by
        return oracle.fk(q), excess

    def _gives_way(self, target, failure):
        """Whether the pose is reached if only the named joints exceed their limits, as far as the diagnosis says."""
        by = {name: abs(excess) + _ROOM for name, excess in zip(failure.joints, failure.excess, strict=True)}
        return bool(self._oracle.reaches(target, self._rng, *self._oracle.widened(by)))

    def _one_limit(self, kind):
        """No posture inside the limits reaches the pose. One does with a single joint beyond its limit, by the amount
        that the case was built with."""
        target, excess = self._beyond([self._rng.integers(len(self._chain))])
        if self._oracle.reaches(target, self._rng) is not False:
            return None
        most = max(excess.values()) + _ROOM

        def right(failure):
            return (failure.reason is Reason.JOINT_LIMIT and len(failure.joints) == 1 and failure.excess[0] <= most
                    and self._gives_way(target, failure))

        return Case(kind, target, right)

    def _two_limits(self, kind):
        """No single joint beyond its limits is enough."""
        target, _ = self._beyond(self._rng.choice(len(self._chain), 2, replace=False))
        alone = ({name: 2.0 * np.pi} for name in self._oracle.names)
        if self._oracle.reaches(target, self._rng) is not False or any(
                self._oracle.reaches(target, self._rng, *self._oracle.widened(by)) is not False for by in alone):
            return None

        def right(failure):
            return (failure.reason is Reason.JOINT_LIMIT and len(failure.joints) > 1
                    and self._gives_way(target, failure))

        return Case(kind, target, right)

    # -- collisions ----------------------------------------------------------------------------------------------

    def _touches(self, target):
        """Return {(link, link, with the world): share} of the deepest contacts of all postures found. It is {} if a
        posture is free of contacts or there are too few postures."""
        found, _ = self._oracle.solutions(target, self._rng)
        touches = Counter()
        if len(found) < _ENOUGH:
            return {}
        for q in found:
            touch = self.checker.contact(self._chain.joint_names, q)
            if touch is None:
                return {}
            touches[touch[:3]] += 1
        return {key: times / len(found) for key, times in touches.items()}

    def _posture(self):
        return self._rng.uniform(self._oracle.lower, self._oracle.upper)

    def _touches_itself(self, kind):
        q = self._posture()
        if self.checker.contact(self._chain.joint_names, q) is None:
            return None
        target = self._oracle.fk(q)
        return self._touching(kind, target, self._touches(target), False)

    def _touches_world(self, kind):
        """A box stands at the hand's target position, or a little behind it."""
        target = self._oracle.fk(self._posture())
        post = tuple(target[:3, 3] - self._rng.uniform(0.0, 0.15) * target[:3, 2])
        self._stand(post)
        touches = self._touches(target)
        self._stand(None)
        return self._touching(kind, target, touches, True, post)

    def _touching(self, kind, target, touches, with_world, post=None):
        often = {frozenset(key[:2]) for key, share in touches.items() if share >= _OFTEN and key[2] == with_world}
        other = sum(share for key, share in touches.items() if key[2] != with_world)
        # If half of the postures touch one pair and half another, there is no single cause.
        if not often or other > _OFTEN:
            return None
        wanted = Reason.WORLD_COLLISION if with_world else Reason.SELF_COLLISION

        def right(failure):
            return failure.reason is wanted and frozenset(failure.pair) in often

        return Case(kind, target, right, post=post)

    # -- not converged -------------------------------------------------------------------------------------------

    def _not_converged(self, kind, budget):
        """The pose was made from a posture, so it has a solution. The case is left out if the short search finds
        one."""
        target = self._oracle.fk(self._posture())
        try:
            solve(self._chain, target, self._chain.mid_range, budget=budget)
        except NoSolution:
            return Case(kind, target, lambda failure: failure.reason is Reason.NOT_CONVERGED, budget)
        return None

    def _cut_short(self, kind):
        return self._not_converged(kind, Budget(max_starts=1, max_iterations=int(self._rng.integers(1, 4))))

    def _too_fine(self, kind):
        """The tolerance is finer than the resolution of a double at this distance."""
        return self._not_converged(kind, Budget(tolerance_m=1e-18, tolerance_rad=1e-18))


KINDS = {
    "beyond the links' length": 12, "wrist beyond the links' length": 12, "in no orientation like this": 18,
    "a point out of reach": 8, "one joint's limit": 40, "two joints' limits": 6, "touches itself": 32,
    "touches the world": 24, "search cut short": 12, "tolerance too fine": 6,
}
