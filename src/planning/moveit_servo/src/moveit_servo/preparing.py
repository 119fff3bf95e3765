# SPDX-License-Identifier: BSD-3-Clause
"""The command of this package that makes what a servo needs of a robot's shape. It needs no master."""
from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import yaml

from model_files.resources import ResourceFinder
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.planners.planning import sphere_model_of
from motion_planning.scene import Scene
from moveit_servo.convex_parts import ConvexParts, cuts_named
from moveit_servo.surroundings import Surroundings
from urdf_model import description_text


def prepare_servo(arguments: Sequence[str] | None = None) -> int:
    """``prepare_servo``: make what a servo of a robot's arms loads from disk. Returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="prepare_servo", description="Make all that a servo needs to know of a robot's shape, so that its first "
        "start does not wait for it.")
    parser.add_argument("urdf", type=Path, help="the robot: URDF or xacro file")
    parser.add_argument("srdf", type=Path, help="its groups: SRDF or xacro file")
    parser.add_argument("parameters", type=Path, help="the servo's parameters, a YAML file, of which mesh_cuts counts")
    options = parser.parse_args(arguments)
    try:
        values = yaml.safe_load(options.parameters.read_text(encoding="utf-8"))
        if not isinstance(values, dict):
            raise ValueError("%s holds %r; expected the servo's parameters" % (options.parameters, values))
        model = PlanningModel.from_xml(description_text(options.urdf), description_text(options.srdf))
        spheres = sphere_model_of(ExactChecker(model, MeshReader(ResourceFinder())))
        scene = ConvexParts(spheres, cuts_named(values.get("mesh_cuts", ""), model)).added_to(Scene(model))
        arm = next((group for group in model.groups.values() if group.joints), None)
        if arm is None:
            raise ValueError("%s has no group with joints that move; expected the group of an arm" % options.srdf)
        Surroundings(spheres, arm, scene)  # any arm's is of the whole robot
    except BrokenPipeError:
        raise  # of the standard output: rospy_fixes ends the program without a word
    except (ValueError, OSError, yaml.YAMLError) as error:
        print("prepare_servo: %s" % error, file=sys.stderr)
        return 1
    return 0
