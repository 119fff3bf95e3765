#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draw the robot and each world of baxter_gazebo as the cameras' renderer shows them, as stills.

./baxter.sh sim docs/pictures/draw_worlds.py           # all, into docs/pictures
./baxter.sh sim docs/pictures/draw_worlds.py cafe      # one

The worlds' bodies have settled for a second of simulated time; the conveyor has run for longer.
"""
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rospkg
from PIL import Image

import xacro
from baxter_model import MIRROR_SIGNS, SIDES, joint_names, poses
from bullet_sim import Pose, World
from gazebo_ros.world_file import read_world
from gazebo_ros.world_lights import WorldLights, lights_of_links
from model_files.resources import ResourceFinder, model_folders, model_sizes
from sdf_model import ModelFolders, SdfWorld
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import Pinhole
from sensor_renderer.viewpoint import looking_at
from urdf_model import MergedFrame, drawing_urdf, merge_fixed, parse_urdf
from urdf_model.transforms import quaternion_from_matrix
from world_picture.drawing import DrawingCache

FOLDER = Path(__file__).resolve().parent
SIZE, QUALITY = (1280, 800), 88
BASE_M = 0.93  # the height of the robot's base above the floor
SETTLE_S = 1.0
# Angles of the left arm [rad]: its hand over a table. The right arm has them mirrored.
OVER_TABLE = (-0.55, -0.75, -0.25, 1.35, 0.20, 0.95, 0.0)
# The left arm at the pose of the second lab [rad]; and at neutral.
SHOWN = (-1.0051, -1.0358, -0.3310, 1.7034, 0.3051, 0.8611, -1.4742)
NEUTRAL = tuple(poses().angles("neutral", "left")[name] for name in joint_names("left"))
BAXTER = ("baxter_description", "urdf/baxter.urdf.xacro")
WITH_KINECT = ("cwru_baxter_sim", "cwru_baxter.urdf.xacro")


class WorldView(NamedTuple):
    """``eye``, ``target`` [m]; ``field_rad``: the picture's width; ``arms``: of the left and the right, both as the
    left's [rad]; ``seconds``: how long the world has run; ``robot``: package and file of its description; ``camera``:
    the frame of the robot that looks, instead of ``eye``."""

    world: str
    eye: tuple
    target: tuple
    field_rad: float = 0.9
    arms: tuple = (OVER_TABLE, OVER_TABLE)
    seconds: float = SETTLE_S
    robot: tuple = BAXTER
    camera: str = ""


VIEWS = {
    "robot": WorldView("baxter", (3.5, 0.55, 1.5), (0.1, 0.0, 0.98), 0.93),
    "lab2": WorldView("baxter", (3.0, 1.3, 1.75), (0.25, 0.05, 0.93), 0.97, (SHOWN, NEUTRAL)),
    "hands": WorldView("table", (1.95, 0.2, 1.42), (0.7, 0.0, 0.93), 0.8),
    "kinect": WorldView("table", (1.35, -0.35, 1.45), (0.12, 0.0, 1.68), 0.7, robot=WITH_KINECT),
    "hand_camera": WorldView("table", (), (), 1.2, camera="left_hand_camera"),
    "lamp": WorldView("cafe", (1.75, -0.85, 1.3), (0.85, 0.02, 0.86), 0.75),
    "table": WorldView("table", (2.75, 1.55, 1.9), (0.35, 0.05, 1.08), 0.98),
    "shelf": WorldView("shelf", (-0.15, -2.6, 1.75), (0.62, 0.0, 0.97), 1.02, (SHOWN, SHOWN)),
    "conveyor": WorldView("conveyor", (3.1, 1.7, 1.9), (0.45, 0.25, 0.9), 1.05, seconds=7.0),
    "cafe": WorldView("cafe", (-1.9, -2.9, 2.1), (2.0, 0.5, 0.75), 1.05),
    "class_room": WorldView("class_room", (5.3, -3.2, 2.2), (0.6, 0.6, 0.85), 1.05),
}


def robot_entry(view: WorldView) -> tuple[dict[str, Any], list[float], dict[str, MergedFrame]]:
    """(entry of the scene, state, frames) of the robot."""
    package, file = view.robot
    path = "%s/%s" % (rospkg.RosPack().get_path(package), file)
    xml = xacro.process_file(path).toxml()
    merged = merge_fixed(parse_urdf(xml, source=path))
    angles = dict(poses().angles("untucked", "left"))
    for side, arm, signs in zip(SIDES, view.arms, ([1] * 7, list(MIRROR_SIGNS.values())), strict=True):
        angles.update(zip(joint_names(side), np.multiply(signs, arm), strict=True))
    joints = list(merged.joints.values())
    state = [0.0, 0.0, BASE_M, 0.0, 0.0, 0.0, 1.0, *(angles.get(joint.name, 0.0) for joint in joints)]
    return {"name": "robot", "urdf": xml, "joints": [joint.name for joint in joints]}, state, merged.frames


def settled(description: SdfWorld, seconds: float) -> tuple[list[dict[str, Any]], list[list[float]], dict[str, Any]]:
    """(entries, states) of a world's models after ``seconds``, and its light."""
    world = World(time_step_s=description.time_step_s, gravity=description.gravity, find_mesh=ResourceFinder())
    entries, states = [], []
    try:
        for model in description.models:
            world.spawn(model.robot, model.name, Pose.from_matrix(model.pose), static=model.static)
        belts = [model for model in world.models.values() if "belt_joint" in model.joint_names]
        for _ in range(round(seconds / description.time_step_s)):
            for model in belts:
                model.carry(model.index(["belt_joint"]), np.zeros(1), np.array([0.1]))
            world.step()
        for read, model in zip(description.models, world.models.values(), strict=True):
            merged = merge_fixed(read.robot)
            is_floor = read.name == "ground_plane"
            pose = model.link_pose(merged.root).matrix()
            entries.append({"name": read.name, "urdf": None if is_floor else drawing_urdf(merged),
                            "joints": list(model.joint_names), "lights": lights_of_links(read.robot, merged, print)})
            states.append([*pose[:3, 3], *quaternion_from_matrix(pose), *model.read_joints()[0]])
    finally:
        world.close()
    return entries, states, WorldLights(description.lights, description.scene).listed()


def draw(name: str, view: WorldView) -> Path:
    """Draw one picture; return its path."""
    packages = rospkg.RosPack()
    folders = ModelFolders(model_folders(packages), model_sizes(packages))
    file = "%s/worlds/%s.world" % (packages.get_path("baxter_gazebo"), view.world)
    entries, states, light = settled(read_world(file, folders), view.seconds)
    robot, state, frames = robot_entry(view)
    mirror = Mirror(DrawingCache(), ResourceFinder(packages), print)
    mirror.set_scene([*entries, robot], light)
    mirror.set_state(np.concatenate([*states, state]))
    pose = looking_at(view.eye, view.target) if not view.camera else (
        mirror.bodies["robot"].link_matrix(frames[view.camera].link) @ frames[view.camera].offset)
    renderer = GlRenderer(still=True)
    picture, _ = renderer.render(mirror, Pinhole.from_field_of_view(*SIZE, view.field_rad, 0.05, 100.0), pose)
    renderer.close()
    path = FOLDER / ("still_%s.webp" % name)
    Image.fromarray(picture).save(path, quality=QUALITY, method=6)
    return path


def main() -> None:
    """Draw the pictures that the command line names, or all."""
    unknown = [name for name in sys.argv[1:] if name not in VIEWS]
    if unknown:
        sys.exit("no picture is called %s; there are %s" % (", ".join(unknown), ", ".join(VIEWS)))
    for name in sys.argv[1:] or VIEWS:
        print(draw(name, VIEWS[name]))


if __name__ == "__main__":
    main()
