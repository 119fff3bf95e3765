# SPDX-License-Identifier: BSD-3-Clause
"""help_of_programs.py FOLDER PROGRAM…: run `PROGRAM --help` of each, some at a time, and print one line of JSON.
PROGRAM is a file, or -mMODULE.

The line is a list of [exit code or None, standard output, standard error]; None: it did not end in LIMIT_S. Each runs
in a child of this process, which has imported most of what they import: one by one, they would take minutes.
"""
import json
import os
import runpy
import select
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import NamedTuple

LIMIT_S = 120.0
AT_A_TIME = 4
COMMON = ("actionlib", "arm_kinematics", "baxter_interface", "baxter_sim_kinematics", "bullet_sim", "cv2",
          "dynamic_reconfigure.server", "gazebo_msgs.srv", "lab_display.show", "motion_planning.pipeline",
          "moveit_ros_move_group.node", "numpy", "rospy", "tf2_ros", "tornado.web", "visualization_msgs.msg")


def become(program: str):
    """Run the program in this process as Python would, and end with its exit code."""
    sys.argv, sys.path[0] = [program, "--help"], str(Path(program).parent)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    code = 0
    try:
        if program.startswith("-m"):
            runpy.run_module(program[2:], run_name="__main__", alter_sys=True)
        else:
            runpy.run_path(program, run_name="__main__")
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


class Running(NamedTuple):
    """A child that runs `program`, its output's files, and when it has to have ended."""

    program: str
    child: int
    files: list[Path]
    end: float


def begun(folder: Path, program: str) -> Running:
    """Begin `program --help`."""
    files = [folder / (program.replace("/", "+") + ending) for ending in (".out", ".err")]
    child = os.fork()
    if child == 0:
        for number, file in enumerate(files, 1):
            os.dup2(os.open(file, os.O_CREAT | os.O_WRONLY | os.O_TRUNC), number)
        become(program)
    return Running(program, child, files, time.monotonic() + LIMIT_S)


def said(running: Running, ended: bool) -> tuple[int | None, str, str]:
    """Exit code and output of one that has ended, or whose time is over."""
    if not ended:
        os.kill(running.child, signal.SIGKILL)
    _, status = os.waitpid(running.child, 0)
    code = os.waitstatus_to_exitcode(status) if ended else None
    return code, *(file.read_text(errors="replace") for file in running.files)


def answers(folder: Path, programs: list[str]) -> dict[str, tuple[int | None, str, str]]:
    """{program: what it said}. All children come from this one thread: one that is forked while another thread holds a
    lock may wait for it for ever."""
    waiting, running, found = list(programs), {}, {}
    while waiting or running:
        while waiting and len(running) < AT_A_TIME:
            one = begun(folder, waiting.pop(0))
            running[os.pidfd_open(one.child)] = one
        left = min(one.end for one in running.values()) - time.monotonic()
        ended = select.select(list(running), [], [], max(left, 0.0))[0]
        for descriptor, one in list(running.items()):
            if descriptor in ended or time.monotonic() > one.end:
                found[one.program] = said(one, descriptor in ended)
                os.close(descriptor)
                del running[descriptor]
    return found


def main():
    folder, programs = Path(sys.argv[1]), sys.argv[2:]
    os.environ["TMPDIR"] = str(folder)  # os._exit leaves what a program removes at its end
    for name in COMMON:
        __import__(name)
    found = answers(folder, programs)
    print(json.dumps([found[program] for program in programs]))


if __name__ == "__main__":
    main()
