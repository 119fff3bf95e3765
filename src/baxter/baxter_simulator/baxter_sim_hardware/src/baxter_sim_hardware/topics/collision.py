# SPDX-License-Identifier: BSD-3-Clause
"""ROS interface of the arms' safety: collision states, and the messages that suppress safety functions."""
import numpy as np
from baxter_core_msgs.msg import CollisionAvoidanceState, CollisionDetectionState
from std_msgs.msg import Header

from baxter_model import BASE_FRAME, SIDES
from baxter_model.description import arm_radius, head_guards
from baxter_model.self_collision import BODY
from baxter_sim_hardware.arms import avoidance, collision
from sim_time.pace import Schedule
from sim_time.stamps import stamp

from .row import STATE_RATE_HZ, Part, Topic

CHECK_RATE_HZ = 100.0  # rate of the checks of contacts and suppressions


def _suppress(kind):
    def handle(part, side, msg, time_s):
        part.suppressions[side].take(kind, time_s)

    return handle


def guards_of(robot):
    """`avoidance.Guards` of an urdf_model.Robot."""
    balls = head_guards(robot)
    return avoidance.Guards(tuple(name for name, _, _ in balls),
                            np.array([centre for _, centre, _ in balls]).reshape(-1, 3),
                            np.array([radius for _, _, radius in balls]) + arm_radius(robot))


class CollisionTopics(Part):
    """world, model: of bullet_sim; baxter: `robot.Baxter`; chains: {side: Chain}; guards: `avoidance.Guards`; feel:
    function (side, snapshot) -> (torques (7,), wrench (6,)) from outside; is_squeezed: function(side) -> whether its
    cuff is.
    """

    def __init__(self, world, model, baxter, chains, guards, feel, is_squeezed):
        self._world, self._model, self._baxter, self._arms = world, model, baxter, baxter.arms
        self._chains, self._guards = chains, guards
        self.fields = dict.fromkeys(SIDES, avoidance.FREE)
        self._feel, self._is_squeezed = feel, is_squeezed
        self.suppressions = {side: collision.Suppressions() for side in SIDES}
        self._schedule = Schedule(CHECK_RATE_HZ)

    def reset(self):
        for suppressions in self.suppressions.values():
            suppressions.reset()

    def update(self, time_s, enabled):
        """Before a step: let the arms yield, float or fall, depending on contacts, cuffs and messages."""
        if not self._schedule.due(time_s):
            return
        contacts = self._contacts()
        for side, suppressions in self.suppressions.items():
            self._arms.set_yielding(side, bool(contacts and self._touched(contacts, side, time_s)[0]))
            self.fields[side] = self._field(side, time_s)
            self._arms.set_slowing(side, self.fields[side].slowing)
            self._arms.set_gravity_compensation(side, not suppressions.active(collision.GRAVITY, time_s))
            floats = enabled and self._is_squeezed(side) and not suppressions.active(collision.CUFF, time_s)
            self._arms.set_floating(side, floats)

    def _field(self, side, time_s):
        if any(self.suppressions[side].active(kind, time_s)
               for kind in (collision.AVOIDANCE, collision.BODY_AVOIDANCE)):
            return avoidance.FREE
        position = self._baxter.measured.position[self._arms.joints_of(side)]
        return avoidance.field(self._guards, *self._chains[side].joint_frames(position), self._arms.wanted_rates(side))

    def too_near(self):
        """Which arms are in the field around the head, so that a physical robot could not be enabled; "" for none."""
        near = ["the %s arm (%s)" % (side, ", ".join(field.near)) for side in SIDES
                if (field := self._field(side, self._world.time_s)).near]
        if not near:
            return ""
        return ("in the field of collision avoidance: %s; unfold the arms by rosrun baxter_tools tuck_arms.py -u, "
                "which suppresses it" % " and ".join(near))

    def _contacts(self):
        """[(link, link)] of the robot's own contacts that overlap or press."""
        return [(contact.link_a, contact.link_b) for contact in self._world.contacts(self._model, self._model)
                if contact.distance <= 0.0 or contact.force > 0.0]

    def _touched(self, contacts, side, time_s):
        suppressions = self.suppressions[side]
        if suppressions.active(collision.AVOIDANCE, time_s):
            contacts = []
        elif suppressions.active(collision.BODY_AVOIDANCE, time_s):
            contacts = [pair for pair in contacts if BODY not in pair]
        return collision.touched(contacts, side)

    def _avoidance(self, time_s, side, snapshot):
        links, other_arm = self._touched(self._contacts(), side, time_s)
        near = sorted((*links, *self.fields[side].near))
        return CollisionAvoidanceState(Header(stamp=stamp(time_s), frame_id=BASE_FRAME), other_arm, near)

    def _detection(self, time_s, side, snapshot):
        suppressions = self.suppressions[side]
        torques, wrench = self._feel(side, snapshot)
        collides = ((collision.is_squeezed(torques) and not suppressions.active(collision.CONTACT, time_s))
                    or (collision.is_overloaded(wrench) and not suppressions.active(collision.OVERWRENCH, time_s)))
        return CollisionDetectionState(Header(stamp=stamp(time_s), frame_id=BASE_FRAME), collides)

    TOPICS = (
        Topic("collision_avoidance_state", "limb/{limb}/collision_avoidance_state",
              "baxter_core_msgs/CollisionAvoidanceState", STATE_RATE_HZ, _avoidance,
              "the links of the robot that this arm touches, whether the other arm is among them, and the guards of "
              "the head (`collision_head_link_1`, `_2`) that it is within 0.03 m of"),
        Topic("collision_detection_state", "limb/{limb}/collision_detection_state",
              "baxter_core_msgs/CollisionDetectionState", STATE_RATE_HZ, _detection,
              "whether a joint feels more than 16 Nm (s0, e0, e1), 24 Nm (s1), 7 Nm (wrist) from outside, or the hand "
              "more than 100 N or 30 Nm"),
        *(Topic(kind, "limb/{limb}/" + kind, "std_msgs/Empty", None, _suppress(kind), "for 0.6 s: " + meaning)
          for kind, meaning in collision.SUPPRESSIONS.items()),
    )
