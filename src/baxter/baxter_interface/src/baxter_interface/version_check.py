# SPDX-License-Identifier: BSD-3-Clause
"""Check that this SDK fits the robot's software. Free of ROS."""
from __future__ import annotations

import errno
import re
from typing import Any


class VersionMismatch(OSError):
    """The robot's software and this SDK do not fit together.

    An OSError, like every refusal of RobotEnable, so that `except OSError` and `error.strerror` work on it. Uncaught,
    it ends a program with exit status 1, as in the original SDK.
    """

    def __init__(self, text: str) -> None:
        super().__init__(errno.EPROTO, text)


def require_compatible(robot_version: Any, sdk_version: str, robots_by_sdk: dict[str, list[str]]) -> None:
    """Check the text of the robot's software version against a table of those that each SDK works with.

    Only the first three numbers count: "1.2.0", "1.2.0.57" and "1.2.0-rc1" are the same robot software. Raises
    VersionMismatch, which says what was found and how to correct it.
    """
    accepted = robots_by_sdk[sdk_version]
    advice = (
        "This SDK %s works with robot software %s. On the simulator: rosparam set /rethink/software_version %s.57; "
        "on a robot: update it or use the SDK that belongs to it; RobotEnable(versioned=False) skips this check."
        % (sdk_version, " or ".join(accepted), accepted[-1])
    )
    numbers = re.match(r"\d+\.\d+\.\d+", str(robot_version))
    if numbers is None:
        raise VersionMismatch(
            "the robot's software version is %r, which does not begin with three numbers like 1.2.0. %s"
            % (robot_version, advice))
    if numbers.group() not in accepted:
        raise VersionMismatch("the robot's software version is %s. %s" % (robot_version, advice))
