# SPDX-License-Identifier: BSD-3-Clause
"""A full disk ends a program's log file with one line, instead of a traceback for each message that it logs.

Messages still go to the terminal and to /rosout. Only handlers of files are concerned, and only errors about room.
"""
from __future__ import annotations

import errno
import functools
import logging
import sys
from typing import Any

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT)


def amend(module: Any) -> None:
    """Called when rosgraph.roslogging, which opens ROS's log files, has been loaded."""
    del module
    handle = logging.FileHandler.handleError

    @functools.wraps(handle)
    def handle_error(self, record):
        error = sys.exc_info()[1]
        if not isinstance(error, OSError) or error.errno not in _NO_ROOM:
            handle(self, record)
            return
        if not getattr(self, "has_told_of_full_disk", False):
            self.has_told_of_full_disk = True
            if sys.stderr is not None:
                sys.stderr.write("the log file %s has no more room: %s. The program goes on without it; make room, for "
                                 "instance with: rosclean purge\n" % (self.baseFilename, error.strerror))

    logging.FileHandler.handleError = handle_error
