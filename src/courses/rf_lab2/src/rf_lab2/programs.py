# SPDX-License-Identifier: BSD-3-Clause
"""Start and end of the lab's programs."""
from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import Any

import rospy

from baxter_interface import startup


class LabProgramFailed(Exception):
    """The program did not reach its aim; the text says why."""


def run(node_name: str, body: Callable[[], Any]) -> int:
    """Wait for the robot, become the node `node_name`, call `body()`; return the exit status.

    0 after success; 1 after LabProgramFailed, OSError, ValueError or an error of ROS, with one line on stderr; 130
    after Ctrl-C.
    """
    try:
        startup.init_node(node_name)
        body()
    except rospy.ROSInterruptException:
        return 130
    except BrokenPipeError as error:
        if error.errno == errno.ESHUTDOWN:  # Ctrl-C while the SDK waited
            return 130
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (LabProgramFailed, OSError, ValueError, rospy.ROSException, rospy.ServiceException) as error:
        print("%s: %s" % (os.path.basename(sys.argv[0]), getattr(error, "strerror", None) or error), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0
