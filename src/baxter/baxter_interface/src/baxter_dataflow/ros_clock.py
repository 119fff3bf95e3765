# SPDX-License-Identifier: BSD-3-Clause
"""ROS time as a clock to wait on."""
import time

import rospy

from .waiting import Stopwatch

# A simulation that runs ticks hundreds of times a second; longer silence is worth a word to the one who waits.
STALL_NOTICE_S = 5.0
# How often a sleeper looks up although the clock did not tick, to notice a shutdown [s, wall].
LOOK_UP_S = 0.2


class RosClock:
    """ROS time (wall time, or /clock under use_sim_time), with a warning when simulated time stands still."""

    def now(self):
        """Read the time [s]; under simulated time 0 until the first /clock message.

        Raises rospy.ROSInitException before rospy.init_node.
        """
        return rospy.get_time()

    def is_shutdown(self):
        return rospy.is_shutdown()

    def sleep(self, duration_s):
        """Sleep for `duration_s` of ROS time. Returns early at shutdown; time that jumps back is no error."""
        if rospy.rostime.is_wallclock():
            time.sleep(max(0.0, duration_s))
            return
        ticked = rospy.rostime.get_rostime_cond()
        watch = Stopwatch(self.now())
        last_s, moved_at_s = self.now(), time.monotonic()
        while watch.elapsed_s(self.now()) < duration_s and not rospy.is_shutdown():
            with ticked:
                ticked.wait(LOOK_UP_S)
            if self.now() != last_s:
                last_s, moved_at_s = self.now(), time.monotonic()
            elif time.monotonic() - moved_at_s > STALL_NOTICE_S:
                rospy.logwarn(
                    "simulated time stands still at %.3f s: is the simulation paused or gone? "
                    "(rosservice call /gazebo/unpause_physics)", last_s)
                moved_at_s = time.monotonic()
