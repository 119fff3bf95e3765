# SPDX-License-Identifier: BSD-3-Clause
"""The messages on /diagnostics, and when they are sent."""
from types import SimpleNamespace

from diagnostic_msgs.msg import DiagnosticStatus

from gazebo_ros.diagnostics import MESSAGES, Diagnostics
from loop_ros.faults import Faults
from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.threads import ThreadFaults


def test_diagnostics_tell_what_was_dropped_and_which_plugin_failed():
    hosted = SimpleNamespace(label="libpanel.so", model_name="baxter", failures=0, last_error="", has_failed=False)
    simulation = SimpleNamespace(step_s=0.002, tick=0, time_ns=0, plugins=[hosted])
    sent, faults = [], Faults(SimpleNamespace(error=lambda text: None))
    publisher = SimpleNamespace(has_listeners=True, publish=sent.append)
    threads = ThreadFaults(EventLog(sent.append))
    ros = SimpleNamespace(publisher=lambda topic, msg_class: publisher)
    diagnostics = Diagnostics(simulation, faults, threads, ros)
    for simulation.tick in range(1, 1001):
        diagnostics.on_tick()
    assert len(sent) == 2
    status, = sent[-1].status
    assert (status.name, status.level) == (MESSAGES, DiagnosticStatus.OK)

    faults.note("/robot/command", ValueError("wrong"))
    hosted.failures, hosted.last_error = 1, "update() raised ValueError: x"
    dropped, plugin = diagnostics.statuses()
    assert dropped.level == plugin.level == DiagnosticStatus.WARN
    pair, = dropped.values
    assert (pair.key, pair.value) == ("/robot/command", "1, the newest: ValueError: wrong")
    hosted.failures, hosted.has_failed = 3, True
    plugin = diagnostics.statuses()[1]
    assert plugin.level == DiagnosticStatus.ERROR and "libpanel.so of baxter" in plugin.name
    assert {pair.key: pair.value for pair in plugin.values} == {"failures": "3",
                                                                "newest": "update() raised ValueError: x"}

    threads.note("that accepts connections", OSError("broken"))
    thread = diagnostics.statuses()[1]
    assert thread.level == DiagnosticStatus.WARN and thread.name.startswith("gazebo: ")
    assert [pair.key for pair in thread.values] == ["that accepts connections"] and "OSError" in thread.values[0].value
