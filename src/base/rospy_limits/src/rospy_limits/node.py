# SPDX-License-Identifier: BSD-3-Clause
"""Installs the limits."""
from __future__ import annotations

import contextlib
import resource
import threading
import time
from collections.abc import Callable
from typing import Any

import rosgraph.xmlrpc
import rospy
import rospy.impl.masterslave as masterslave
import rospy.impl.registration as rospy_registration
import rospy.impl.tcpros_base as tcpros_base
import rospy.impl.tcpros_service as tcpros_service
import rospy.topics

from rospy_limits import limits, messages, registration, services, tcpros_server, xmlrpc_server
from rospy_limits.event_log import EventLog
from rospy_limits.threads import STATUS_NAME, ThreadFaults, lasting
from rospy_limits.topic_poller import TopicPoller

# Shortest time between two messages about threads [s].
_PUBLISH_S = 1.0
_installed = []


def limit_ports(publishes: bool = True) -> ThreadFaults:
    """Install the limits in this process. Call it before ``rospy.init_node``, which opens the ports; a second call
    changes nothing.

    Returns the errors that threads met. ``publishes``: from the first one on, they are published on /diagnostics.
    """
    if _installed:
        return _installed[0]
    events = EventLog(rospy.logwarn)
    faults = ThreadFaults(events)
    _installed.append(faults)
    threading.excepthook = faults.count_ends(threading.excepthook)
    if publishes:
        threading.Thread(target=lasting(faults, "that publishes on /diagnostics", _publish(faults), _PUBLISH_S),
                         args=(rospy.is_shutdown,), name="thread faults", daemon=True).start()
    _ask_for_files()
    tcpros_base.TCPServer = tcpros_server.limited_server(events, faults)
    tcpros_base.TCPROSServer._tcp_server_callback = tcpros_server.connection_handler(events)
    protocol, transport = tcpros_base.TCPROSTransportProtocol, tcpros_base.TCPROSTransport
    protocol.read_messages = messages.checked_read(protocol.read_messages)
    transport.receive_once = messages.reported_receive(transport.receive_once, events)
    tcpros_base.read_ros_handshake_header = registration.read_header
    client = tcpros_service.TCPROSServiceClient
    client.read_messages = messages.checked_answer(client.read_messages)
    service: Any = tcpros_service.ServiceImpl
    service.handle, service._write_service_error = services.connection_server(events, faults), services.write_error
    rosgraph.xmlrpc.ThreadingXMLRPCServer = xmlrpc_server.limited_server(events, faults)
    manager, handler = rospy_registration.RegManager, masterslave.ROSHandler
    manager.run = registration.lasting_run(manager.run, faults)
    handler.publisherUpdate = registration.limited_update(handler.publisherUpdate)
    rospy.topics.Poller = TopicPoller
    return faults


def _publish(faults: ThreadFaults) -> Callable[[Callable[[], bool]], None]:
    """The loop of the thread that publishes the errors of threads, if there are any."""
    def publish(ends: Callable[[], bool]) -> None:
        publisher = None
        while not ends():
            faults.news.wait()
            if rospy.core.is_initialized():
                # Imported here: most nodes never need it.
                from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

                publisher = publisher or rospy.Publisher("/diagnostics", DiagnosticArray, latch=True, queue_size=1)
                faults.news.clear()
                text, values = faults.summary() or ("", {})
                name = rospy.get_name()
                message = DiagnosticArray(status=[DiagnosticStatus(
                    DiagnosticStatus.WARN, "%s: %s" % (name, STATUS_NAME), text, name,
                    [KeyValue(*row) for row in values.items()])])
                message.header.stamp = rospy.Time.now()
                publisher.publish(message)
            time.sleep(_PUBLISH_S)
    return publish


def _ask_for_files() -> None:
    """Raise the limit of open files as far as the system allows, up to the useful maximum."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = limits.OPEN_FILES if hard == resource.RLIM_INFINITY else min(limits.OPEN_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
