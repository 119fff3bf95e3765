# SPDX-License-Identifier: BSD-3-Clause
"""The node rosout, which roslaunch starts beside a master, hears no clock.

It needs none: lines of its log have the stamps of their messages. In simulated time each message of /clock wakes it, at
500 Hz 2 % of a core, and has to be sent to it.
"""
from __future__ import annotations

import functools
from typing import Any

_REMAPPED = ["/clock", "/rosout/no_clock"]


def amend(config: Any) -> None:
    """Called when roslaunch.config, which reads ROS's roscore.xml, has been loaded."""
    load = config.load_roscore

    @functools.wraps(load)
    def load_roscore(loader, found, *args, **kwargs):
        load(loader, found, *args, **kwargs)
        for node in found.nodes_core:
            if (node.package, node.type) == ("rosout", "rosout") and not node.remap_args:
                node.remap_args.append(_REMAPPED)

    config.load_roscore = load_roscore
