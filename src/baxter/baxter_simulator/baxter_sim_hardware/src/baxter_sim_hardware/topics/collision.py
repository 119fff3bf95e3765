# SPDX-License-Identifier: BSD-3-Clause
"""The arms' safety as ROS sees it: states of collision, and the messages that suppress what makes an arm safe."""
from baxter_core_msgs.msg import CollisionAvoidanceState, CollisionDetectionState
from std_msgs.msg import Header

from baxter_model import BASE_FRAME, SIDES
from baxter_model.self_collision import BODY
from baxter_sim_hardware.arms import collision
from sim_time.pace import Schedule
from sim_time.stamps import stamp

CHECK_RATE_HZ = 100.0  # how often the arms look what they touch, and what is suppressed


class CollisionTopics:
    """makers and takers: as in PanelTopics. world, model: of bullet_sim; arms: `arms.Arms`; feel: function
    (side, snapshot) -> (torques (7,), wrench (6,)) from outside; is_squeezed: function(side) -> whether its cuff is."""

    def __init__(self, world, model, arms, feel, is_squeezed):
        self._world, self._model, self._arms = world, model, arms
        self._feel, self._is_squeezed = feel, is_squeezed
        self._suppressions = {side: collision.Suppressions() for side in SIDES}
        self._schedule = Schedule(CHECK_RATE_HZ)
        self.makers = {"collision_avoidance_state": self._avoidance, "collision_detection_state": self._detection}
        self.takers = {kind: self._taker(kind) for kind in collision.SUPPRESSIONS}

    def reset(self):
        for suppressions in self._suppressions.values():
            suppressions.reset()

    def update(self, time_s, enabled, position, velocity):
        """Before a step: have the arms yield, float and fall as contacts, cuffs and messages say. (n,) measured."""
        if not self._schedule.due(time_s):
            return
        contacts = self._contacts()
        for side, suppressions in self._suppressions.items():
            self._arms.set_yielding(side, bool(contacts and self._touched(contacts, side, time_s)[0]))
            self._arms.set_gravity_compensation(side, not suppressions.active(collision.GRAVITY, time_s))
            floats = enabled and self._is_squeezed(side) and not suppressions.active(collision.CUFF, time_s)
            self._arms.set_floating(side, floats, position, velocity)

    def _taker(self, kind):
        return lambda side, msg, time_s: self._suppressions[side].take(kind, time_s)

    def _contacts(self):
        """[(link, link)] of the robot's own contacts that overlap or press."""
        return [(contact.link_a, contact.link_b) for contact in self._world.contacts(self._model, self._model)
                if contact.distance <= 0.0 or contact.force > 0.0]

    def _touched(self, contacts, side, time_s):
        suppressions = self._suppressions[side]
        if suppressions.active(collision.AVOIDANCE, time_s):
            contacts = []
        elif suppressions.active(collision.BODY_AVOIDANCE, time_s):
            contacts = [pair for pair in contacts if BODY not in pair]
        return collision.touched(contacts, side)

    def _avoidance(self, time_s, side, snapshot):
        links, other_arm = self._touched(self._contacts(), side, time_s)
        return CollisionAvoidanceState(Header(stamp=stamp(time_s), frame_id=BASE_FRAME), other_arm, links)

    def _detection(self, time_s, side, snapshot):
        suppressions = self._suppressions[side]
        torques, wrench = self._feel(side, snapshot)
        collides = ((collision.is_squeezed(torques) and not suppressions.active(collision.CONTACT, time_s))
                    or (collision.is_overloaded(wrench) and not suppressions.active(collision.OVERWRENCH, time_s)))
        return CollisionDetectionState(Header(stamp=stamp(time_s), frame_id=BASE_FRAME), collides)
