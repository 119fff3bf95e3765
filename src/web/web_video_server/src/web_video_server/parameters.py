# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of web_video_server, by their published names. No ROS."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from web_bridge.parameters import Endpoint, ParameterError, access_of, number, port_of, switch, warnings_of
from web_bridge.video import QueryError, VideoOptions, check_type


class VideoServerParameters(NamedTuple):
    """Parameters of the node. ``threads`` encode images; ``warnings`` for its log."""

    endpoint: Endpoint
    threads: int
    is_verbose: bool
    video: VideoOptions
    warnings: tuple


def read_parameters(get: Callable[[str, Any], Any]) -> VideoServerParameters:
    """``get(name, default)`` returns a parameter of the node. Raises ParameterError."""
    address = str(get("address", "localhost"))
    access = access_of(get)
    name = str(get("default_stream_type", "mjpeg"))
    try:
        check_type(name)
    except QueryError as error:
        raise ParameterError("~default_stream_type: %s" % error) from None
    number(get, "server_threads", 1)  # one loop serves all clients
    threads = int(number(get, "ros_threads", 2))
    if not 1 <= threads <= 64:
        raise ParameterError("~ros_threads is %d; 1 to 64 threads can encode images" % threads)
    return VideoServerParameters(Endpoint(port_of(get, 8080), address), threads, switch(get, "verbose", True),
                                 VideoOptions(access, name, _period(get)),
                                 warnings_of(address, access, "see what the robot's cameras see"))


def _period(get: Callable[[str, Any], Any]) -> float:
    """Seconds after which a stream's last image is sent again; 0: never, which web_video_server writes as -1."""
    rate = get("publish_rate", -1)
    if not isinstance(rate, bool) and isinstance(rate, int | float) and rate <= 0:
        return 0.0
    rate = number(get, "publish_rate", 0.0)
    return 1 / min(rate, 1000.0) if rate else 0.0
