# SPDX-License-Identifier: BSD-3-Clause
"""ROS interface of the arms' safety: collision states, and the messages that suppress safety functions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from baxter_core_msgs.msg import CollisionAvoidanceState, CollisionDetectionState
from std_msgs.msg import Header

from baxter_model import BASE_FRAME
from baxter_sim_hardware.arms import collision
from sim_time.stamps import stamp

from .row import STATE_RATE_HZ, RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Callable

    from std_msgs.msg import Empty

    from baxter_sim_hardware.arms.guarding import Guarding
    from baxter_sim_hardware.snapshot import JointSnapshot


def _suppress(kind: str) -> Callable[[CollisionTopics, str, Empty, float], None]:
    def handle(part, side, msg, time_s):
        part.suppressions[side].take(kind, time_s)

    return handle


class CollisionTopics(RobotPart):
    """guarding: `arms.guarding.Guarding`."""

    def __init__(self, guarding: Guarding) -> None:
        self._guarding, self.suppressions = guarding, guarding.suppressions

    def _avoidance(self, time_s: float, side: str, snapshot: JointSnapshot) -> CollisionAvoidanceState:
        links, other_arm = self._guarding.near(side, time_s)
        return CollisionAvoidanceState(Header(stamp=stamp(time_s), frame_id=BASE_FRAME), other_arm, links)

    def _detection(self, time_s: float, side: str, snapshot: JointSnapshot) -> CollisionDetectionState:
        return CollisionDetectionState(Header(stamp=stamp(time_s), frame_id=BASE_FRAME),
                                       self._guarding.collides(side, time_s, snapshot))

    TOPICS = (
        TopicRow("collision_avoidance_state", "limb/{limb}/collision_avoidance_state",
                 "baxter_core_msgs/CollisionAvoidanceState", STATE_RATE_HZ, _avoidance,
                 "the links of the robot that this arm touches, whether the other arm is among them, and the guards of "
                 "the head (`collision_head_link_1`, `_2`) that it is within 0.03 m of; with the effect `safety` also "
                 "the links of the other arm, torso and pedestal, that it is kept away from"),
        TopicRow("collision_detection_state", "limb/{limb}/collision_detection_state",
                 "baxter_core_msgs/CollisionDetectionState", STATE_RATE_HZ, _detection,
                 "whether a joint feels more than 16 Nm (s0, e0, e1), 24 Nm (s1), 7 Nm (wrist) from outside, or the "
                 "hand more than 100 N or 30 Nm; with the effect `safety` such an arm stops for 2 s"),
        *(TopicRow(kind, "limb/{limb}/" + kind, "std_msgs/Empty", None, _suppress(kind), "for 0.6 s: " + meaning)
          for kind, meaning in collision.SUPPRESSIONS.items()),
    )
