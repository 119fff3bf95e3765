# SPDX-License-Identifier: BSD-3-Clause
"""`rosrun lab_display show`: the functions of `show` on the command line."""
from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import rospy

from baxter_interface import startup
from command_line.options import number, seconds

from . import show

# How far the camera of a picture may be, and what it looks at [m].
FARTHEST_M = 1e6
EPILOG = "Exit status: 0 shown, 1 there was nothing to show (standard error says why), 2 wrong options."


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(prog="show", description="Show the robot, its joints and its frames.", epilog=EPILOG)
    commands = top.add_subparsers(dest="what", required=True, metavar="WHAT")

    def add(name: str, text: str, picture: bool = True):
        command = commands.add_parser(name, help=text, description=text)
        if picture:
            command.add_argument("--out", metavar="FILE.png", type=Path,
                                 help="where the picture goes (default: %s.png; in the workspace's own folder below "
                                 ".baxter/pictures)" % name)
        return command

    robot = add("robot", "the simulated world from outside")
    robot.add_argument("frames", nargs="*", metavar="FRAME", help="tf frames to draw into it: x red, y green, z blue")
    robot.add_argument("--eye", nargs=3, type=number(float, -FARTHEST_M, FARTHEST_M), metavar=("X", "Y", "Z"),
                       help="where the camera stands [m]")
    robot.add_argument("--target", nargs=3, type=number(float, -FARTHEST_M, FARTHEST_M), metavar=("X", "Y", "Z"),
                       help="where it looks [m]")
    add("camera", "what a camera of the robot sees").add_argument("name", help="head_camera, or the image's topic")
    joints = add("joints", "positions of joints over time")
    joints.add_argument("names", nargs="*", metavar="JOINT", help="which joints (default: all)")
    joints.add_argument("--topic", default=show.JOINT_STATES, help="joint states (default: %(default)s)")
    joints.add_argument("--seconds", type=seconds(), default=5.0, help="how long [s, simulated] (default: %(default)s)")
    for name, text in (("tf", "the frames that tf knows"), ("urdf", "links and joints of the robot's description")):
        tree = add(name, text)
        tree.add_argument("--below", metavar="FRAME", help="from this frame down")
        tree.add_argument("--text", action="store_true", help="print it instead of drawing it")
    matrix = add("matrix", "where one frame is in another, as a 4x4 matrix", picture=False)
    matrix.add_argument("target")
    matrix.add_argument("source", help="the pose of SOURCE is given in TARGET")
    return top


def _joints(arguments: Any) -> Any:
    with show.recording(arguments.topic, arguments.names or None) as log:
        rospy.sleep(arguments.seconds)
    return show.plot(log)


def _tree(arguments: Any) -> Any:
    tree = (show.tf_tree if arguments.what == "tf" else show.urdf_tree)(below=arguments.below)
    return tree if arguments.text else tree.draw()


ACTIONS = {
    "robot": lambda arguments: show.picture(arguments.eye, arguments.target, arguments.frames),
    "camera": lambda arguments: show.camera(arguments.name),
    "joints": _joints,
    "tf": _tree,
    "urdf": _tree,
    "matrix": lambda arguments: show.matrix(arguments.target, arguments.source),
}


def picture_path(name: str, here: Path, workspace: str) -> Path:
    """Where a picture goes: into the current folder; but where this is the workspace's topmost one, below .baxter.

    ``workspace``: "" where none is known.
    """
    is_top = workspace and here.samefile(workspace)
    return here / ".baxter" / "pictures" / (name + ".png") if is_top else Path(name + ".png")


def main() -> int:
    """Show it; returns the exit code."""
    arguments = parser().parse_args(rospy.myargv()[1:])
    try:
        startup.init_node("lab_display", topic="/clock", anonymous=True)
        startup.wait_for_start([])
        shown = ACTIONS[arguments.what](arguments)
        if hasattr(shown, "save"):
            path = arguments.out or picture_path(arguments.what, Path.cwd(), os.environ.get("LAB_ROOT", ""))
            path.parent.mkdir(parents=True, exist_ok=True)
            shown.save(path)
            print(path)
        else:
            print(shown)
    except BrokenPipeError:
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (OSError, ValueError, show.ShowError, rospy.ROSException) as error:
        print("show: %s" % (getattr(error, "strerror", None) or error), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0
