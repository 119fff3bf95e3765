# SPDX-License-Identifier: BSD-3-Clause
"""The priority of programs that draw: physics comes first.

    python3 -m sensor_renderer.priority 10 COMMAND...      # as a launch-prefix

Linux may put all processes of a session into one group. Groups share the processors equally, and a nice value then
counts only within its group ("The autogroup feature", sched(7)). roslaunch starts each node in a session of its own, so
the group of the node has to give way as well.
"""
import contextlib
import os
import sys

#: Niceness of programs that draw. Beside programs that take all they get, a group of the lowest priority has 1.5 % of a
#: processor, and a camera's first picture took a minute; one of this priority has 10 %.
DRAWING = 10
_OWN_GROUP = "/proc/self/autogroup"


def give_way(niceness):
    """Lower the priority of this process, and that of its session where it leads one; niceness: 1 to 19, the lowest."""
    os.nice(niceness)
    # Elsewhere the group is that of a terminal, with other programs in it.
    if os.getsid(0) == os.getpid():
        # Not all kernels have such groups.
        with contextlib.suppress(OSError), open(_OWN_GROUP, "w", encoding="ascii") as file:
            file.write(str(os.nice(0)))


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
