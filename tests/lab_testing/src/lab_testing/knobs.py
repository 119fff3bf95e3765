# SPDX-License-Identifier: BSD-3-Clause
"""The knobs of a fake node are parameters below its name, such as "/fake_robot"."""
import rospy
from std_srvs.srv import Trigger

from lab_testing.waiting import DEADLINE_S, stretched


def set_only(fake: str, **knobs: object) -> None:
    """Set the knobs of a fake, all others to their defaults; for a fake that reads them all the time."""
    if rospy.has_param(fake):
        rospy.delete_param(fake)
    for name, value in knobs.items():
        rospy.set_param(fake + "/" + name, value)


def reload(fake: str) -> None:
    """Let a fake read its knobs; they are in force when this returns."""
    rospy.wait_for_service(fake + "/reload", stretched(DEADLINE_S))
    rospy.ServiceProxy(fake + "/reload", Trigger)()


def set_knobs(fake: str, **knobs: object) -> None:
    """Set the knobs of a fake, all others to their defaults; in force when this returns."""
    set_only(fake, **knobs)
    reload(fake)
