# SPDX-License-Identifier: BSD-3-Clause
"""The node foxglove_bridge: reads its parameters and listens."""
from __future__ import annotations

from typing import Any

import rospy

from foxglove_bridge.parameters import read_parameters
from web_bridge import ros_graph, ros_node
from web_bridge.codec import Codec
from web_bridge.foxglove.bridge import FoxgloveBridge, FoxgloveOptions
from web_bridge.foxglove.socket import FoxgloveSocket
from web_bridge.loop_thread import LoopThread
from web_bridge.ros_foxglove import FoxgloveGraph, options_of_graph
from web_bridge.websocket import Clients


def main() -> int:
    """Returns the exit code."""
    return ros_node.run("foxglove_bridge", read_parameters, _serve)


def _serve(parameters: Any) -> None:
    loop_thread = LoopThread("foxglove")
    session_id, metadata, sim_time = options_of_graph()
    bridge = FoxgloveBridge(
        FoxgloveGraph(parameters.probe_s), Codec(ros_graph.message_class, ros_graph.now), loop_thread.later,
        parameters.socket.rules,
        FoxgloveOptions(rospy.get_name(), session_id, metadata, parameters.longest_look_s, sim_time))
    clients = Clients(bridge, loop_thread, parameters.socket)
    ros_node.serve_clients(clients, clients.application(socket=FoxgloveSocket), parameters.endpoint, "Foxglove")
    bridge.close()
    loop_thread.stop()
