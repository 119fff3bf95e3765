# SPDX-License-Identifier: BSD-3-Clause
"""The priority of programs that draw: physics comes first.

    python3 -m sensor_renderer.priority 10 COMMAND...      # as a launch-prefix

Debian's rviz now and then ends with a segmentation fault while it opens its window, before it has drawn or asked
anything. Then the command is started once more.
"""
from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from typing import NoReturn

from processes.family import with_parent
from processes.priority import give_way

#: Niceness of programs that draw. Beside programs that take all they get, a group of the lowest priority has 1.5 % of a
#: processor, and a camera's first picture took a minute; one of this priority has 10 %.
DRAWING = 10
#: A program that has run for longer was in use, and ends with its fault [s].
OPENING_S = 20.0
MAX_STARTS = 3
_PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def run(command: list[str]) -> int:
    """Run a command until it ends by itself; return its exit code, negative for a signal. Raises OSError."""
    if shutil.which(command[0]) is None:
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
    stopped = False
    child: subprocess.Popen | None = None

    def stop(number, frame):
        nonlocal stopped
        stopped = True
        if child is not None:
            child.send_signal(number)

    for number in _PASSED_ON:
        signal.signal(number, stop)
    for start in range(1, MAX_STARTS + 1):
        begin_s = time.monotonic()
        child = subprocess.Popen(with_parent(command))
        code = child.wait()
        if code != -signal.SIGSEGV or stopped or time.monotonic() - begin_s > OPENING_S or start == MAX_STARTS:
            break
        print("%s ended with a segmentation fault while it opened its window; it is started again"
              % os.path.basename(command[0]), file=sys.stderr, flush=True)
    return code


def main() -> NoReturn:
    """Run a command at a low priority, and end as it does."""
    if len(sys.argv) < 3 or sys.argv[1] not in map(str, range(20)):
        sys.exit("usage: python3 -m sensor_renderer.priority NICENESS COMMAND..., with a niceness of 0 to 19")
    give_way(int(sys.argv[1]))
    try:
        code = run(sys.argv[2:])
    except OSError as error:
        sys.exit("%s cannot be run: %s" % (sys.argv[2], error.strerror))
    if code < 0:
        signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    sys.exit(code)


if __name__ == "__main__":
    main()
