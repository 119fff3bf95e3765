# SPDX-License-Identifier: BSD-3-Clause
"""``/rosdistro`` is "noetic" where Debian's environment says "Debian".

Clients of rosbridge choose by it how messages look: compas_fab ends with an error for a name that it does not know.
Debian's packages, and those of this workspace, have noetic's messages.
"""
from __future__ import annotations

import functools
from typing import Any

_DEBIANS, _NAME = "Debian", "noetic\n"  # with the end of the line, as on noetic: it is what a command has printed


def amend(config: Any) -> None:
    """Called when roslaunch.config, which reads ROS's roscore.xml, has been loaded."""
    load = config.load_roscore

    @functools.wraps(load)
    def load_roscore(loader, found, *args, **kwargs):
        load(loader, found, *args, **kwargs)
        name = found.params.get("/rosdistro")
        if name is not None and str(name.value).strip() == _DEBIANS:
            name.value = _NAME

    config.load_roscore = load_roscore
