# SPDX-License-Identifier: BSD-3-Clause
"""The status of an action server while its node ends."""
from types import SimpleNamespace

import pytest
import rospy

from baxter_interface import goal_loop


@pytest.mark.parametrize("ends", [True, False])
def test_a_status_on_a_closed_topic_is_an_error_only_while_the_node_runs(monkeypatch, ends):
    def publish(event):
        raise rospy.ROSException("publish() to a closed topic")

    callbacks = []
    monkeypatch.setattr(rospy, "Timer", lambda period, callback, reset: callbacks.append(callback))
    monkeypatch.setattr(rospy.core, "_in_shutdown", ends)  # set before topics are closed; is_shutdown() comes after
    goal_loop.start(SimpleNamespace(start=lambda: None, status_frequency=5.0, publish_status_async=publish,
                                    status_timer=SimpleNamespace(shutdown=lambda: None)))
    if ends:
        callbacks[0](None)
    else:
        with pytest.raises(rospy.ROSException, match="closed topic"):
            callbacks[0](None)
