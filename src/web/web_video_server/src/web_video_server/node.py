# SPDX-License-Identifier: BSD-3-Clause
"""The node web_video_server: reads its parameters and listens."""
from __future__ import annotations

from typing import Any

import rospy
from tornado import web

from web_bridge import ros_graph, ros_node
from web_bridge.cameras import Cameras
from web_bridge.codec import Codec
from web_bridge.loop_thread import LoopThread
from web_bridge.parameters import ParameterError
from web_bridge.serving import Serving
from web_bridge.video import VideoServer, routes
from web_video_server.parameters import read_parameters


def main() -> int:
    """Returns the exit code."""
    return ros_node.run("web_video_server", read_parameters, _serve)


def _serve(parameters: Any) -> None:
    loop_thread = LoopThread("video")
    cameras = Cameras(ros_graph.RosGraph(), Codec(ros_graph.message_class, ros_graph.now), loop_thread,
                      parameters.threads)
    told = rospy.loginfo if parameters.is_verbose else rospy.logdebug
    video = VideoServer(cameras, parameters.video._replace(told=lambda text: told("%s", text)))
    application = web.Application(routes(video), log_function=lambda handler: None)
    port, address, *_ = parameters.endpoint
    try:
        serving = Serving(loop_thread, application, port, address)
    except OSError as error:
        raise ParameterError("port %d of '%s' cannot be opened: %s; _port:=N chooses another one"
                             % (port, address, error)) from None
    ros_node.announce(serving.port)
    rospy.loginfo("Waiting for connections on http://%s:%d", address or "0.0.0.0", serving.port)
    rospy.spin()
    loop_thread.run(video.close_all())
    serving.close()
    cameras.shut_down()
    loop_thread.stop()
