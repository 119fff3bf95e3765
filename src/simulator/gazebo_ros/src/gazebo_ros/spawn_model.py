# SPDX-License-Identifier: BSD-3-Clause
"""Put a model into the running simulator: a URDF or SDF from a file, a parameter, the standard input or a model folder.

    rosrun gazebo_ros spawn_model -urdf -param robot_description -model baxter -z 0.93 -J left_s1 -0.55
"""
from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import threading
from typing import TYPE_CHECKING

import rospkg
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from std_msgs.msg import Empty

from command_line.user_files import PIPE_WAIT_S, read_text
from gazebo_ros import gazebo_interface
from gazebo_ros.urdf_extras import ExtrasError, unscoped, with_start_configuration
from master_calls.simulator_start import SPAWNING
from model_files.resources import model_folders
from sdf_model import description_file
from urdf_model import bounds
from urdf_model.transforms import quaternion_from_matrix, rpy_matrix

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path


def arguments(argv: Iterable[str]) -> argparse.Namespace:
    """The command line, parsed."""
    # Launch files are full of "-1e-05", which argparse takes for an option; a blank in front makes it a value.
    argv = [" " + word if word.startswith("-") and is_number(word) else word for word in argv]
    parser = argparse.ArgumentParser(prog="spawn_model", description=(__doc__ or "").split("\n")[0], allow_abbrev=False)
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument("-urdf", action="store_true", help="the description is a URDF")
    kind.add_argument("-sdf", action="store_true", help="the description is an SDF")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("-file", metavar="FILE", help="read the description from a file")
    source.add_argument("-param", metavar="NAME", help="read it from a ROS parameter")
    source.add_argument("-database", metavar="MODEL", help="read the description in a model's folder "
                        "(along GAZEBO_MODEL_PATH, ~/.gazebo/models, and our own models)")
    source.add_argument("-stdin", action="store_true", help="read it from the standard input")
    parser.add_argument("-model", metavar="NAME", required=True, help="name of the model in the world")
    parser.add_argument("-reference_frame", metavar="NAME", default="", help="model or model::link that the pose is "
                        "given in; default: the world")
    parser.add_argument("-gazebo_namespace", metavar="NS", default="/gazebo", help="default: /gazebo")
    parser.add_argument("-robot_namespace", metavar="NS", default=None, help="namespace of plugins that name none; "
                        "default: the namespace of this node")
    parser.add_argument("-unpause", action="store_true", help="let the world run afterwards")
    parser.add_argument("-wait", metavar="MODEL", help="wait until that model is in the world")
    parser.add_argument("-b", dest="bond", action="store_true", help="stay, and delete the model at the end")
    parser.add_argument("-package_to_model", action="store_true", help="turn package:// into model:// in mesh names")
    for axis, unit in (("x", "m"), ("y", "m"), ("z", "m"), ("R", "roll, rad"), ("P", "pitch, rad"), ("Y", "yaw, rad")):
        parser.add_argument("-" + axis, type=float, default=0.0, help=unit)
    parser.add_argument("-J", dest="joints", nargs=2, action="append", default=[], metavar=("JOINT", "POSITION"),
                        help="joint position at the start, rad or m; may be repeated")
    options = parser.parse_args(argv)
    try:
        options.joints = [(name, float(position)) for name, position in options.joints]
    except ValueError as error:
        parser.error("-J takes a joint name and a number: %s" % error)
    for option in ("param", "gazebo_namespace"):
        name = getattr(options, option) or ""
        if not name.isprintable():  # the master cannot read it
            parser.error("-%s %s is no name in ROS: it has characters that cannot be printed" % (option, ascii(name)))
    return options


def is_number(word: str) -> bool:
    """Whether ``word`` reads as a float."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def read_description(options: argparse.Namespace) -> str:
    """The text of the description; raises ``GazeboInterfaceError``."""
    if options.stdin:
        return sys.stdin.read()
    if options.param:
        name = rospy.resolve_name(options.param)
        gazebo_interface.wait_until(lambda: rospy.has_param(name), "the parameter %s" % name)
        return rospy.get_param(name)
    path = options.file or database_file(options.database, options.urdf)
    try:
        return read_text(path, bounds.DESCRIPTION_BYTES, pipe_wait_s=PIPE_WAIT_S)
    except (OSError, UnicodeDecodeError) as error:
        raise gazebo_interface.GazeboInterfaceError("cannot read %s: %s" % (path, error)) from error


def database_file(model: str, is_urdf: bool) -> Path:
    """The description in the folder of a model; raises ``GazeboInterfaceError``."""
    folders = model_folders()
    for folder in folders:
        path = folder / model / "model.urdf" if is_urdf else description_file(folder / model)
        if path is not None and path.is_file():
            return path
    raise gazebo_interface.GazeboInterfaceError("model %s not found as %s; looked in %s" % (
        model, "model.urdf" if is_urdf else "SDF", ", ".join(map(str, folders))))


def initial_pose(options: argparse.Namespace) -> Pose:
    """``geometry_msgs/Pose`` from -x -y -z -R -P -Y."""
    rotation = rpy_matrix(options.R, options.P, options.Y)
    return Pose(Point(options.x, options.y, options.z), Quaternion(*quaternion_from_matrix(rotation)))


def spawn(options: argparse.Namespace) -> bool:
    """Do what the options say; True when the model is in the world."""
    xml = read_description(options)
    if options.package_to_model:
        xml = re.sub("package://", "model://", xml)
    # The joint positions travel inside the description, so that the model is never seen in any other pose.
    xml = with_start_configuration(xml, [(unscoped(options.model, name), value) for name, value in options.joints])
    if options.wait:
        gazebo_interface.wait_for_model(options.wait, options.gazebo_namespace)
    client = gazebo_interface.spawn_urdf_model_client if options.urdf else gazebo_interface.spawn_sdf_model_client
    namespace = rospy.get_namespace() if options.robot_namespace is None else options.robot_namespace
    if not client(options.model, xml, namespace, initial_pose(options), options.reference_frame,
                  options.gazebo_namespace):
        return False
    if options.unpause:
        gazebo_interface.unpause_client(options.gazebo_namespace)
    return True


def main(argv: list[str]) -> int:
    """``argv``: the command line, which begins with the program. Returns the exit code."""
    options = arguments(rospy.myargv(argv)[1:])
    # Made first, so that the master knows from the start that this node is working.
    at_work = rospy.Publisher(SPAWNING, Empty, queue_size=1)
    # All waits are in wall time, so /clock is not needed.
    rospy.init_node("spawn_model", anonymous=True, disable_rostime=True, disable_signals=True)
    ending = threading.Event()

    def end(*_):
        ending.set()
        if not options.bond:
            os._exit(1)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    try:
        if not spawn(options):
            return 1
        at_work.unregister()
        if options.bond:
            rospy.loginfo("model %s stays until this ends (Ctrl-C)", options.model)
            ending.wait()
            gazebo_interface.delete_model_client(options.model, options.gazebo_namespace)
    except (gazebo_interface.GazeboInterfaceError, ExtrasError, rospkg.ResourceNotFound, OSError) as error:
        rospy.logerr("spawn_model: %s", error)
        return 1
    finally:
        rospy.signal_shutdown("done")
    return 0

