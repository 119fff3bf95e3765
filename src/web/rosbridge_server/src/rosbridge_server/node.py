# SPDX-License-Identifier: BSD-3-Clause
"""The node rosbridge_websocket: reads its parameters, listens, and says who is connected."""
from __future__ import annotations

from typing import Any

import rospy
from rosbridge_msgs.msg import ConnectedClient, ConnectedClients
from std_msgs.msg import Int32

from rosbridge_server.parameters import read_parameters
from web_bridge import ros_graph, ros_node
from web_bridge.codec import Codec
from web_bridge.loop_thread import LoopThread
from web_bridge.session import Bridge
from web_bridge.websocket import Clients


class ClientTopics:
    """Publishes who is connected."""

    def __init__(self) -> None:
        self._count = rospy.Publisher("client_count", Int32, latch=True, queue_size=1)
        self._clients = rospy.Publisher("connected_clients", ConnectedClients, latch=True, queue_size=1)
        self.publish([])

    def publish(self, clients: list[tuple[str, float]]) -> None:
        """``clients``: (address, time of connection) of each."""
        self._count.publish(len(clients))
        self._clients.publish([ConnectedClient(address, rospy.Time.from_sec(when)) for address, when in clients])


def main() -> int:
    """Returns the exit code."""
    return ros_node.run("rosbridge_websocket", read_parameters, _serve)


def _serve(parameters: Any) -> None:
    loop_thread = LoopThread("rosbridge")
    bridge = Bridge(ros_graph.RosGraph(), Codec(ros_graph.message_class, ros_graph.now), loop_thread.later,
                    parameters.bridge)
    clients = Clients(bridge, loop_thread, parameters.socket, ClientTopics().publish)
    ros_node.serve_clients(clients, clients.application(), parameters.endpoint, "Rosbridge")
    loop_thread.stop()
