# SPDX-License-Identifier: BSD-3-Clause
"""Enable, disable, stop and reset the robot."""
from __future__ import annotations

import copy
import errno
import math
import threading
import time
from typing import Any

import rospy
from baxter_core_msgs.msg import AssemblyState
from std_msgs.msg import Bool, Empty

from baxter_dataflow import wait_for
from baxter_model import SIDES
from baxter_model.readiness import RESET

from . import settings, startup
from .hindrance import ask_what_holds
from .version_check import VersionMismatch, require_compatible

# Time limit for the robot to carry out each request [s, ROS time].
ENABLE_TIMEOUT_S = 2.0
DISABLE_TIMEOUT_S = 5.0
RESET_TIMEOUT_S = 3.0
STOP_TIMEOUT_S = 3.0
VERSION_PARAMETER = "rethink/software_version"


class RobotEnable:
    """The robot's main switch: its state, and the requests that change it.

    Parameters:
        versioned: compare the robot's software version with this SDK's.
    Waits up to 30 s of wall time for a robot that is still starting.
    Raises OSError with errno ETIMEDOUT if it does not come up, VersionMismatch (an OSError) if `versioned` and the
    versions do not fit, rospy.ROSInitException before rospy.init_node.
    """

    def __init__(self, versioned: bool = False) -> None:
        self._lock = threading.Lock()
        self._state = None
        self._heard_at_s = -math.inf
        self._subscriber = rospy.Subscriber("robot/state", AssemblyState, self._on_state, queue_size=1)
        conditions = [startup.message_arrives(str(self._subscriber.resolved_name), lambda: self._state is not None)]
        if versioned:
            conditions.insert(0, startup.parameter_set(rospy.resolve_name(VERSION_PARAMETER)))
        try:
            startup.wait_for_start(conditions)
            if versioned:
                _require_version()
        except BaseException:
            self._subscriber.unregister()
            raise

    def state(self) -> Any:
        """Return the last state that the robot reported, as a copy (baxter_core_msgs/AssemblyState)."""
        with self._lock:
            return copy.copy(self._state)

    def close(self) -> None:
        """Listen to the robot's state no longer: for programs that need the switch only now and then. Not in the
        vendor's SDK."""
        self._subscriber.unregister()

    def silence_s(self) -> float:
        """Return the time since the robot's last state [s, wall]; a present robot publishes it all the time."""
        with self._lock:
            return time.monotonic() - self._heard_at_s

    def enable(self) -> None:
        """Switch the motors on; a stopped robot is reset first.

        Raises OSError: errno ETIMEDOUT if it is not enabled within 2 s, EREMOTEIO if its stop button is pressed.
        """
        if self.state().stopped:
            rospy.loginfo("the robot is stopped: resetting it before enabling it")
            self.reset()
        self._request("robot/set_super_enable", Bool(data=True), ENABLE_TIMEOUT_S,
                      lambda state: state.enabled, "enable")

    def disable(self) -> None:
        """Switch the motors off. Raises OSError with errno ETIMEDOUT if they are not off within 5 s."""
        self._request("robot/set_super_enable", Bool(data=False), DISABLE_TIMEOUT_S,
                      lambda state: not state.enabled, "disable")

    def reset(self) -> bool:
        """Clear a stop and errors; the robot is disabled afterwards.

        Returns True, or False if only an error flag could not be cleared: such an error does not keep a robot from
        working. Raises OSError: errno EREMOTEIO if the stop button is pressed, ETIMEDOUT if it is still stopped
        after 3 s.
        """
        before = self.state()
        if before.stopped and before.estop_button == AssemblyState.ESTOP_BUTTON_PRESSED:
            raise OSError(errno.EREMOTEIO, "failed to reset the robot: its stop button is pressed. "
                                           "Turn the button to release it, then reset again")
        try:
            self._request("robot/set_super_reset", Empty(), RESET_TIMEOUT_S, _is_clear, "reset")
        except OSError as failure:
            now = self.state()
            if failure.errno == errno.ETIMEDOUT and now.error and not now.stopped:
                rospy.logwarn("the robot is reset, but an error flag stays set; it may still work (%s)", _brief(now))
                return False
            raise
        return True

    def stop(self) -> None:
        """Stop the robot as its stop button would. Raises OSError with errno ETIMEDOUT if it has not within 3 s."""
        self._request("robot/set_super_stop", Empty(), STOP_TIMEOUT_S, lambda state: state.stopped, "stop")

    def version_check(self) -> bool:
        """Compare the robot's software version with this SDK's: True if they fit; otherwise log why, return False."""
        try:
            _require_version()
        except VersionMismatch as mismatch:
            rospy.logerr("%s", mismatch.strerror)
            return False
        return True

    def _on_state(self, message: Any) -> None:
        with self._lock:
            self._state = message
            self._heard_at_s = time.monotonic()

    def _request(self, topic: str, message: Any, timeout_s: float, is_done, verb: str) -> None:
        """Publish `message` at 100 Hz until `is_done(state)`. Raises OSError with errno ETIMEDOUT or ESHUTDOWN."""
        if is_done(self.state()):
            return
        # latch=False: a latched enable would reach the next robot that comes up.
        publisher = rospy.Publisher(topic, type(message), queue_size=10)
        try:
            # On a busy machine the robot takes a while to connect. One subscriber is enough: others may be dead, and
            # must not delay a stop.
            startup.wait_for_subscribers(publisher, startup.PART_TIMEOUT_S, enough=1)
            wait_for(test=lambda: is_done(self.state()), timeout=timeout_s, rate=100,
                     body=lambda: publisher.publish(message))
        except OSError as failure:
            if failure.errno != errno.ETIMEDOUT:
                raise
            raise OSError(errno.ETIMEDOUT, "failed to %s the robot within %.0f s: %s" % (
                verb, timeout_s, self._why_not(publisher, verb))) from failure
        finally:
            publisher.unregister()

    def _why_not(self, publisher: rospy.Publisher, verb: str) -> str:
        state = self.state()
        if publisher.get_num_connections() == 0:
            return "nobody listens to %s (%s)" % (publisher.resolved_name, _brief(state))
        if state.stopped:
            return "it is stopped; release its stop button and reset it: %s (%s)" % (RESET, _brief(state))
        # A physical robot is not enabled while an arm is in the field of its collision avoidance.
        holds = {side: ask_what_holds(side, is_kept_away=True) for side in SIDES} if verb == "enable" else {}
        return "; ".join(["it was asked but stays %s" % _brief(state),
                          *("the %s arm: %s" % (side, why) for side, why in holds.items() if why)])


def _is_clear(state) -> bool:
    return not (state.enabled or state.stopped or state.error or state.estop_button or state.estop_source)


def _brief(state) -> str:
    return "enabled: %s, stopped: %s, error: %s, estop_button: %d, estop_source: %d" % (
        state.enabled, state.stopped, state.error, state.estop_button, state.estop_source)


def _require_version() -> None:
    version = rospy.get_param(VERSION_PARAMETER, None)
    if version is None:
        raise VersionMismatch(
            "the parameter %s is not set; a robot and the simulator's launch file set it. "
            "By hand: rosparam set /%s %s.57"
            % (rospy.resolve_name(VERSION_PARAMETER), VERSION_PARAMETER, settings.SDK_VERSION))
    require_compatible(version, settings.SDK_VERSION, settings.VERSIONS_SDK2ROBOT)
