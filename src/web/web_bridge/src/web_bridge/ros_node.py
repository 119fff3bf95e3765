# SPDX-License-Identifier: BSD-3-Clause
"""How the nodes around this package start, and how those with WebSockets serve, in rospy."""
from __future__ import annotations

import ssl
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import rospy

from processes.memory import return_large_blocks
from rospy_nodes.start import end_on_signals, limit_ports
from web_bridge import ros_graph
from web_bridge.parameters import ParameterError
from web_bridge.serving import listen

if TYPE_CHECKING:
    from tornado.web import Application

    from web_bridge.parameters import Endpoint
    from web_bridge.websocket import Clients


def run(name: str, read_parameters: Callable[[Callable[[str, Any], Any]], Any], serve: Callable[[Any], object]) -> int:
    """Start the node ``name`` and call ``serve(parameters)``, which returns when the node ends; returns the exit code.

    ``read_parameters(get)`` returns the parameters; their ``warnings`` go to the log. It and ``serve`` may raise
    ParameterError: the log says why, and the exit code is 1.
    """
    return_large_blocks()
    limit_ports()
    end_on_signals()
    rospy.init_node(name, disable_signals=True)
    try:
        parameters = read_parameters(lambda name, default: rospy.get_param("~" + name, default))
        for text in parameters.warnings:
            rospy.logwarn("%s", text)
        serve(parameters)
    except ParameterError as error:
        rospy.logfatal("%s", error)
        return 1
    return 0


def announce(port: int) -> None:
    """Tell clients, tests and scripts the port of a node that was started with ~port 0."""
    rospy.set_param("~actual_port", port)


def serve_clients(clients: Clients, application: Application, endpoint: Endpoint, what: str) -> None:
    """Serve the :class:`web_bridge.websocket.Clients` until the node ends; ``what``: the server's name for the log.

    Waits while the port is taken. Raises ParameterError for a certificate or key that TLS cannot use.
    """
    try:
        serving = listen(clients.loop_thread, application, endpoint, ros_graph.wait, rospy.logerr)
    except (OSError, ssl.SSLError) as error:
        raise ParameterError("~certfile and ~keyfile: %s" % error) from None
    if serving is None:
        return
    announce(serving.port)
    rospy.loginfo("%s WebSocket server started at %s", what, serving.url(endpoint))
    rospy.spin()
    clients.shut_down()
    serving.close()
