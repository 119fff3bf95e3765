# SPDX-License-Identifier: BSD-3-Clause
"""help_of_programs.py FOLDER PROGRAM…: run `PROGRAM --help` of each, some at a time, and print one line of JSON.
PROGRAM is a file, or -mMODULE.

The line is a list of [exit code or None, standard output, standard error]; None: it did not end in LIMIT_S. Each runs
in a child of this process, which has imported most of what they import: one by one, they would take minutes.
"""
import concurrent.futures
import json
import os
import runpy
import select
import signal
import sys
import traceback
from pathlib import Path

LIMIT_S = 60.0
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


def said(folder: Path, program: str) -> tuple[int | None, str, str]:
    """Exit code and output of `program --help`."""
    files = [folder / (program.replace("/", "+") + ending) for ending in (".out", ".err")]
    child = os.fork()
    if child == 0:
        for number, file in enumerate(files, 1):
            os.dup2(os.open(file, os.O_CREAT | os.O_WRONLY | os.O_TRUNC), number)
        become(program)
    end = os.pidfd_open(child)
    ended = select.select([end], [], [], LIMIT_S)[0]
    os.close(end)
    if not ended:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status) if ended else None
    return code, *(file.read_text(errors="replace") for file in files)


def main():
    folder, programs = Path(sys.argv[1]), sys.argv[2:]
    os.environ["TMPDIR"] = str(folder)  # os._exit leaves what a program removes at its end
    for name in COMMON:
        __import__(name)
    with concurrent.futures.ThreadPoolExecutor(AT_A_TIME) as pool:
        print(json.dumps(list(pool.map(lambda program: said(folder, program), programs))))


if __name__ == "__main__":
    main()
