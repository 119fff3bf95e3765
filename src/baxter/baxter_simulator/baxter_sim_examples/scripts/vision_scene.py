#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Puts a table with coloured blocks and a board with a tag in front of the robot, and ends. Calls the services of
/gazebo."""
import argparse
import sys
from pathlib import Path

import rospkg
import rospy
from gazebo_msgs.srv import GetWorldProperties, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion

from baxter_interface.programs import expect, run
from baxter_sim_examples.gazebo_scene import GAZEBO, TABLE
from baxter_sim_examples.scene import BASE_HEIGHT_M, TABLE_XY_M
from baxter_sim_examples.vision_scene import COLOURED, THE_BOARD, PlacedModel, board_urdf
from gazebo_ros.gazebo_interface import call, delete_model_client


def build() -> None:
    models = Path(rospkg.RosPack().get_path("model_files")) / "models"
    table = PlacedModel(TABLE, *TABLE_XY_M, -BASE_HEIGHT_M, 0.0)
    there = call(GAZEBO + "/get_world_properties", GetWorldProperties).model_names
    for thing in (table, *COLOURED, THE_BOARD):
        if thing.name in there:
            delete_model_client(thing.name, GAZEBO)
        kind, xml = ("urdf", board_urdf()) if thing is THE_BOARD else (
            "sdf", (models / thing.name / "model.sdf").read_text())
        (x, y, z), turn = thing.world
        answer = call("%s/spawn_%s_model" % (GAZEBO, kind), SpawnModel, thing.name, xml, "/", Pose(
            Point(x, y, z), Quaternion(*turn)), "world")
        expect(answer.success, "model '%s' cannot be spawned: %s" % (thing.name, answer.status_message))
    rospy.loginfo("on the table: %s", ", ".join(thing.name for thing in (*COLOURED, THE_BOARD)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_known_args()
    sys.exit(run("vision_scene", build))
