# SPDX-License-Identifier: BSD-3-Clause
"""ROS time as a clock to wait on."""
from __future__ import annotations

import time
from collections.abc import Callable

import rosgraph
import rospy

from .waiting import Stopwatch

# A simulation that runs ticks hundreds of times a second; a longer silence is logged.
STALL_NOTICE_S = 5.0
# Period of checks for a shutdown while the clock stands still [s, wall].
LOOK_UP_S = 0.2


class RosClock:
    """ROS time (wall time, or /clock under use_sim_time), with a warning when simulation time does not advance.

    `gives_up()` is called several times a second and ends a sleep when it is true; by default at shutdown.
    """

    def __init__(self, gives_up: Callable[[], object] = rospy.is_shutdown) -> None:
        self._gives_up = gives_up

    def now(self) -> float:
        """Read the time [s]; under simulated time 0 until the first /clock message.

        Raises rospy.ROSInitException before rospy.init_node.
        """
        return rospy.get_time()

    def is_shutdown(self) -> bool:
        return rospy.is_shutdown()

    def sleep(self, duration_s: float) -> None:
        """Sleep for `duration_s` of ROS time. Returns early when `gives_up()` is true; time that jumps back is not
        an error."""
        if rospy.rostime.is_wallclock():
            time.sleep(max(0.0, duration_s))
            return
        ticked = rospy.rostime.get_rostime_cond()
        watch = Stopwatch(self.now())
        last_s, moved_at_s = self.now(), time.monotonic()
        while watch.elapsed_s(self.now()) < duration_s and not self._gives_up():
            with ticked:
                ticked.wait(LOOK_UP_S)
            if self.now() != last_s:
                last_s, moved_at_s = self.now(), time.monotonic()
            elif time.monotonic() - moved_at_s > STALL_NOTICE_S:
                _log_silence(last_s)
                moved_at_s = time.monotonic()


def _log_silence(time_s: float) -> None:
    """Log that simulated time stands still at `time_s`; shut this node down if there is a new master.

    A node registers once; a restarted master does not know it, and would never connect it to anything.
    """
    uri = rosgraph.get_master_uri()
    try:
        rosgraph.Master(rospy.get_name()).lookupNode(rospy.get_name())
    except rosgraph.MasterError:
        rospy.logerr("the ROS master at %s was restarted and does not know this program: start it again", uri)
        rospy.signal_shutdown("the ROS master was restarted")
    except OSError as error:
        rospy.logwarn("simulated time stands still at %.3f s: the ROS master at %s is gone (%s)", time_s, uri, error)
    else:
        rospy.logwarn("simulated time stands still at %.3f s: is the simulation paused or gone? "
                      "(rosservice call /gazebo/unpause_physics)", time_s)
