# SPDX-License-Identifier: BSD-3-Clause
"""Run a procedure of the robot, such as taring or calibrating an arm, and wait for its end."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import rospy
from baxter_core_msgs.msg import RobustControllerStatus

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch, Ticker

from . import startup
from .robust_dialogue import Dialogue, DialogueState, ProcedureReport

if TYPE_CHECKING:
    from genpy import Message

RATE_HZ = 20.0


class RobustController:
    """A procedure below `namespace`, such as "/robustcontroller/left/Tare".

    Parameters:
        enable_msg, disable_msg: the messages that begin and end it, of one type; sent to `namespace`/enable.
        timeout: longest time for it [s, ROS time].
    Raises rospy.ROSInitException before rospy.init_node.
    """

    STATE_IDLE = int(DialogueState.IDLE)
    STATE_STARTING = int(DialogueState.STARTING)
    STATE_RUNNING = int(DialogueState.RUNNING)
    STATE_STOPPING = int(DialogueState.STOPPING)

    def __init__(self, namespace: str, enable_msg: Message, disable_msg: Message, timeout: float = 60) -> None:
        self._namespace = namespace
        self._messages = {True: enable_msg, False: disable_msg}
        self._timeout_s = timeout
        self._report = None
        self._dialogue = None
        self._publisher = rospy.Publisher(namespace + "/enable", type(enable_msg), queue_size=10)
        self._subscriber = rospy.Subscriber(namespace + "/status", RobustControllerStatus, self._on_status,
                                            queue_size=10)

    @property
    def state(self) -> int:
        """One of the STATE_ constants."""
        return int(self._dialogue.state if self._dialogue else DialogueState.IDLE)

    def run(self) -> None:
        """Run the procedure and wait for its end.

        Raises OSError: errno EIO if the robot reports a failure, ENOMSG if it ended without saying how, ETIMEDOUT,
        ECONNABORTED if ROS shut down meanwhile.
        """
        status = str(self._subscriber.resolved_name)
        startup.wait_for_start([startup.topic_published(status)], startup.PART_TIMEOUT_S)
        startup.wait_for_subscribers(self._publisher)
        # Reports from before the request belong to an earlier run.
        self._report = None
        clock = RosClock()
        watch, ticker = Stopwatch(clock.now()), Ticker(clock, RATE_HZ)
        self._dialogue = dialogue = Dialogue(self._timeout_s)
        try:
            while dialogue.state is not DialogueState.IDLE:
                if rospy.is_shutdown():
                    dialogue.abort(watch.elapsed_s(clock.now()))
                    break
                request = dialogue.step(watch.elapsed_s(clock.now()), self._report)
                if request is not None:
                    self._publisher.publish(self._messages[request])
                ticker.sleep()
        except BaseException:
            # For example Ctrl-C: the arm should stop at once, although it would end anyway without further requests.
            if not rospy.is_shutdown():
                self._publisher.publish(self._messages[False])
            raise
        if dialogue.failure:
            number, text = dialogue.failure
            raise OSError(number, "%s: %s" % (self._namespace, text))

    def _on_status(self, message: Any) -> None:
        self._report = ProcedureReport(message.isEnabled, message.complete,
                                       tuple(code for code in (*message.errorCodes, *message.labels) if code))
