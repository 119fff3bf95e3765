# SPDX-License-Identifier: BSD-3-Clause
"""Installs the limits."""
import contextlib
import resource

import rosgraph.xmlrpc
import rospy
import rospy.impl.tcpros_base as tcpros_base
import rospy.impl.tcpros_service as tcpros_service
import rospy.topics

from rospy_limits import limits, messages, services, tcpros_server, xmlrpc_server
from rospy_limits.event_log import EventLog
from rospy_limits.topic_poller import TopicPoller

_installed = []


def limit_ports():
    """Install the limits in this process. Call it before ``rospy.init_node``, which opens the ports; a second call does
    nothing."""
    if _installed:
        return
    events = EventLog(rospy.logwarn)
    _installed.append(events)
    _ask_for_files()
    tcpros_base.TCPServer = tcpros_server.limited_server(events)
    tcpros_base.TCPROSServer._tcp_server_callback = tcpros_server.connection_handler(events)
    protocol, transport = tcpros_base.TCPROSTransportProtocol, tcpros_base.TCPROSTransport
    protocol.read_messages = messages.checked_read(protocol.read_messages)
    transport.receive_once = messages.reported_receive(transport.receive_once, events)
    tcpros_service.ServiceImpl.handle = services.connection_server(events)
    rosgraph.xmlrpc.ThreadingXMLRPCServer = xmlrpc_server.limited_server(events)
    rospy.topics.Poller = TopicPoller


def _ask_for_files():
    """Raise the limit of open files as far as the system allows, up to the useful maximum."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = limits.OPEN_FILES if hard == resource.RLIM_INFINITY else min(limits.OPEN_FILES, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
