# SPDX-License-Identifier: BSD-3-Clause
"""The labs by name: their launch files, and how to recognize a running one. ROS-free."""
from __future__ import annotations

from typing import NamedTuple


class LabStart(NamedTuple):
    """`roslaunch package launch_file arguments...` starts it; `topic` is published by no other lab's robot."""

    package: str
    launch_file: str
    topic: str
    arguments: tuple = ()

    @property
    def command(self) -> tuple[str, str]:
        """The arguments of `roslaunch`."""
        return (self.package, self.launch_file, *self.arguments)


LABS = {
    "baxter": LabStart("baxter_gazebo", "baxter_world.launch", "/robot/limb/left/endpoint_state"),
    "case_western": LabStart("cwru_baxter_sim", "baxter_world.launch", "/kinect/depth/points"),
    "probot": LabStart("probot_gazebo", "probot_anno_bringup_moveit.launch", "/probot_anno/joint_states",
                       ("rviz:=false",)),
}
