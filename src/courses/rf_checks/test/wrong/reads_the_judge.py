# SPDX-License-Identifier: BSD-3-Clause
# exercise: ik_frame
"""Looks for the judge's files and processes, and tries to change the workspace."""
import os
import pathlib
import signal

found = [str(path) for folder in pathlib.Path("/tmp").glob("lab-judge-*") for path in folder.iterdir()]
print("files of the judge:", found)
others = [int(name) for name in os.listdir("/proc") if name.isdigit() and int(name) not in (os.getpid(), os.getppid())]
print("other processes:", others)
for pid in others:
    try:
        os.kill(pid, signal.SIGCONT)
        print("reached", pid)
    except OSError:
        pass
try:
    (pathlib.Path(os.environ["LAB_ROOT"]) / "written_by_a_student").touch()
    print("wrote into the workspace")
except OSError as error:
    print("workspace:", error)
print("reference frame: base")
print("commanded frame: left_gripper")
