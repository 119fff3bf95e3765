#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Update the software of a robot up to version 1.0 from a USB stick that is plugged into it."""
import argparse
import re
import sys
from collections.abc import Sequence

import rospy
from baxter_maintenance_msgs.msg import UpdateSource, UpdateSources, UpdateStatus
from std_msgs.msg import Empty, String

from baxter_dataflow.ros_clock import RosClock
from baxter_interface import startup
from baxter_interface.programs import ProgramFailed, run
from baxter_interface.robot_enable import VERSION_PARAMETER

# The last software that is updated this way.
LAST_VERSION = (1, 0)
# Status texts of a running update; any other text is its end.
UNDER_WAY = {getattr(UpdateStatus, name) for name in (
    "STS_IDLE", "STS_BUSY", "STS_MOUNT_UPDATE", "STS_VERIFY_UPDATE", "STS_PREP_STAGING", "STS_MOUNT_STAGING",
    "STS_EXTRACT_UPDATE")}
STATUS_NAMES = {getattr(UpdateStatus, name): name[len("STS_"):].lower()
                for name in vars(UpdateStatus) if name.startswith("STS_")}
# Longest silence of a working robot [s].
SILENCE_TIMEOUT_S = 60.0
POLL_S = 0.1


def parse_arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="update_robot.py", description=__doc__,
                                     epilog="Exit status: 0 done, 1 failed, 2 wrong options.")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("-l", "--list", action="store_true", help="list the updates on the stick, with their UUIDs")
    action.add_argument("-u", "--update", metavar="UUID", help="start this update")
    return parser.parse_args(argv)


def require_old_robot() -> None:
    version = str(rospy.get_param(VERSION_PARAMETER, "unknown"))
    numbers = re.match(r"(\d+)\.(\d+)", version)
    if numbers is None or tuple(map(int, numbers.groups())) > LAST_VERSION:
        raise ProgramFailed("this robot's software is %s; this tool is for versions up to 1.0. Later ones are updated "
                            "on the robot itself, over SSH" % version)


class Updater:
    """The robot's updater: the updates on the stick, and the progress of an update."""

    def __init__(self) -> None:
        self.sources: Sequence[UpdateSource] = ()
        self._are_known = False  # the sources
        self._status: UpdateStatus | None = None
        self._heard = False
        self._last_line = ""
        self._start = rospy.Publisher("/updater/start", String, queue_size=10)
        self._stop = rospy.Publisher("/updater/stop", Empty, queue_size=10)
        self._subscribers = [
            rospy.Subscriber("/usb/update_sources", UpdateSources, self._on_sources, queue_size=1),
            rospy.Subscriber("/updater/status", UpdateStatus, self._on_status, queue_size=10),
        ]
        startup.wait_for_start([startup.message_arrives("/usb/update_sources", lambda: self._are_known)],
                               SILENCE_TIMEOUT_S)

    def run(self, uuid: str) -> None:
        """Start the update and follow it to its end. Raises ProgramFailed; Ctrl-C stops the update."""
        if uuid not in [source.uuid for source in self.sources]:
            raise ProgramFailed("there is no update %r on the stick: those are %s" % (
                uuid, ", ".join(source.uuid for source in self.sources) or "none"))
        startup.wait_for_subscribers(self._start)
        startup.wait_for_subscribers(self._stop)
        self._status = None
        self._start.publish(uuid)
        clock, silent_s, begun = RosClock(), 0.0, False
        try:
            while not rospy.is_shutdown():
                clock.sleep(POLL_S)
                silent_s = 0.0 if self._heard else silent_s + POLL_S
                status, self._heard = self._status, False
                if silent_s >= SILENCE_TIMEOUT_S:
                    raise ProgramFailed("the robot has said nothing of its update for %.0f s" % silent_s)
                if status is None:
                    continue
                begun = begun or status.status != UpdateStatus.STS_IDLE
                if begun and self._report(status):
                    return
        except KeyboardInterrupt:
            self._stop.publish()
            raise

    def _report(self, status):
        """Print the progress; return whether it is done. Raises ProgramFailed."""
        name = STATUS_NAMES.get(status.status, str(status.status))
        line = "%s %3.0f %% %s" % (name, status.progress, status.long_description)
        if line != self._last_line:
            print(line, flush=True)
            self._last_line = line
        if status.status == UpdateStatus.STS_LOAD_KEXEC:
            return True
        if status.status not in UNDER_WAY:
            raise ProgramFailed("the update has failed: %s %s" % (name, status.long_description))
        return False

    def _on_sources(self, message):
        self.sources, self._are_known = message.sources, True

    def _on_status(self, message):
        self._status, self._heard = message, True


def do(arguments: argparse.Namespace) -> None:
    require_old_robot()
    updater = Updater()
    if arguments.list:
        for source in updater.sources:
            print("%s  %s  %s  %s" % (source.uuid, source.version, source.devname, source.filename))
    else:
        updater.run(arguments.update)


def main() -> int:
    arguments = parse_arguments(rospy.myargv()[1:])
    return run("rsdk_update_robot", lambda: do(arguments))


if __name__ == "__main__":
    sys.exit(main())
