# SPDX-License-Identifier: BSD-3-Clause
"""The priority of programs that draw: physics comes first.

    python3 -m sensor_renderer.priority 10 COMMAND...      # as a launch-prefix
"""
import os
import sys

from lab_environment.priority import give_way

#: Niceness of programs that draw. Beside programs that take all they get, a group of the lowest priority has 1.5 % of a
#: processor, and a camera's first picture took a minute; one of this priority has 10 %.
DRAWING = 10


def main():
    """Run a command at a low priority, in place of this process."""
    if len(sys.argv) < 3 or sys.argv[1] not in map(str, range(20)):
        sys.exit("usage: python3 -m sensor_renderer.priority NICENESS COMMAND..., with a niceness of 0 to 19")
    give_way(int(sys.argv[1]))
    try:
        os.execvp(sys.argv[2], sys.argv[2:])
    except OSError as error:
        sys.exit("%s cannot be run: %s" % (sys.argv[2], error.strerror))


if __name__ == "__main__":
    main()
