# SPDX-License-Identifier: BSD-3-Clause
"""Planning problems: 1,800 published ones with both of Baxter's arms at a shelf, and generated ones for one arm.

The 1,800 (bookshelf_tall_both_arms) are messages in the source archive of vamp-planner, 65 MB, which is downloaded from
PyPI into the user's cache. No code in it is run.
"""
import hashlib
import io
import json
import os
import pickle
import tarfile
import urllib.request
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rospkg
import yaml

import xacro
from model_files.resources import ResourceFinder
from motion_planning.exact import ExactChecker
from motion_planning.model import MeshReader, PlanningModel
from motion_planning.scene import Scene, WorldObject
from urdf_model import Box, Cylinder
from urdf_model.transforms import matrix_from_quaternion, pose_matrix

CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "baxter_bench/planning"
INDEX = "https://pypi.org/simple/vamp-planner/"
ARCHIVE = "vamp_planner-0.6.4.tar.gz"
SHA256 = "d3150c6b67ff941af9ad56480b31d3fb73b12211ea21dc684f7737b059f6daba"
LEVELS = ("easy", "medium", "hard")
# Time limit of the download [s].
PATIENCE_S = 120


@dataclass(frozen=True)
class Robot:
    """A robot with its exact checker."""

    model: PlanningModel
    exact: ExactChecker


@dataclass(frozen=True)
class Problem:
    name: str
    robot: Robot
    scene: Scene
    group: str
    start: np.ndarray
    goal: np.ndarray


def robot(description, urdf, config, srdf, limits=None):
    """Return the Robot of two xacro files in packages. limits: file of joint limits in ``config``, None: the URDF's."""
    packages = rospkg.RosPack()

    def text(package, file):
        return xacro.process_file(str(Path(packages.get_path(package)) / file)).toxml()

    limits = yaml.safe_load((Path(packages.get_path(config)) / limits).read_text()) if limits else None
    model = PlanningModel.from_xml(text(description, urdf), text(config, srdf), limits)
    return Robot(model, ExactChecker(model, MeshReader(ResourceFinder())))


def baxter(limits=None):
    return robot("baxter_description", "urdf/baxter.urdf.xacro", "baxter_moveit_config", "config/baxter.srdf.xacro",
                 limits)


def probot(limits=None):
    return robot("probot_description", "urdf/probot_anno.xacro", "probot_anno_moveit_config", "config/probot_anno.srdf",
                 limits)


# -- the bookshelf --------------------------------------------------------------------------------------------------

def bookshelf(robot):
    """Return the 1,800 Problems: easy, medium, hard. Raises OSError if they cannot be downloaded."""
    return [_bookshelf_problem(robot, *entry) for entry in _messages()]


def _messages():
    """[(name, request, scene)] as plain data; from the cache after the first time."""
    kept = CACHE / "bookshelf.pickle"
    if kept.exists():
        return pickle.loads(kept.read_bytes())
    CACHE.mkdir(parents=True, exist_ok=True)
    with tarfile.open(fileobj=io.BytesIO(_archive())) as archive:
        inner = archive.extractfile(ARCHIVE.removesuffix(".tar.gz") + "/resources/baxter/problems.tar.bz2").read()
    texts = {}
    with tarfile.open(fileobj=io.BytesIO(inner)) as archive:
        for member in archive:
            if member.name.endswith(".yaml"):
                texts[member.name] = archive.extractfile(member).read()
    found = []
    for level in LEVELS:
        for name in sorted(name for name in texts if "_%s_" % level in name and "/request" in name):
            request, scene = (yaml.load(texts[one], Loader=yaml.CSafeLoader)
                              for one in (name, name.replace("/request", "/scene")))
            found.append(("%s %s" % (level, Path(name).stem[-4:]), request, scene["world"]["collision_objects"]))
    kept.write_bytes(pickle.dumps(found))
    return found


def _archive():
    request = urllib.request.Request(INDEX, headers={"Accept": "application/vnd.pypi.simple.v1+json"})
    with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
        files = json.load(answer)["files"]
    url = next(file["url"] for file in files if file["filename"] == ARCHIVE)
    with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer:
        content = answer.read()
    if hashlib.sha256(content).hexdigest() != SHA256:
        raise OSError("%s from %s is not what it was: its sha256 is %s" % (ARCHIVE, url,
                                                                          hashlib.sha256(content).hexdigest()))
    return content


def _bookshelf_problem(robot, name, request, objects):
    model, group = robot.model, robot.model.groups["both_arms"]
    joints = request["start_state"]["joint_state"]
    values = dict(zip(joints["name"], joints["position"], strict=True))
    goal = {one["joint_name"]: one["position"] for one in request["goal_constraints"][0]["joint_constraints"]}
    things = []
    for item in objects:
        shapes = tuple((_shape(shape), _pose(where))
                       for shape, where in zip(item["primitives"], item["primitive_poses"], strict=True))
        things.append(WorldObject(item["id"], np.eye(4), shapes))
    scene = Scene(model, model.state({joint: value for joint, value in values.items() if joint in model.index}),
                  allowed=_allowed(robot)).with_objects(things)
    return Problem(name, robot, scene, "both_arms", np.array([values[joint] for joint in group.joints]),
                   np.array([goal[joint] for joint in group.joints]))


def _allowed(robot, known={}):  # noqa: B006  one dict for all scenes: caches use its identity
    return known.setdefault(id(robot), Scene(robot.model).allowed)


def _shape(shape):
    sizes = shape["dimensions"]
    return Box(tuple(map(float, sizes))) if shape["type"] == "box" else Cylinder(float(sizes[1]), float(sizes[0]))


def _pose(where):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix_from_quaternion(np.array(where["orientation"], float)), where["position"]
    return pose


# -- one arm at a table or a shelf ----------------------------------------------------------------------------------

@dataclass(frozen=True)
class Place:
    """Where an arm works. group, tip: the arm; centre: of the furniture, in the planning frame [m]; size: 1
    for Baxter, less for smaller arms."""

    group: str
    tip: str
    centre: tuple
    size: float


BAXTER_PLACE = Place("left_arm", "left_gripper", (0.75, 0.35, 0.0), 1.0)
PROBOT_PLACE = Place("manipulator", "tool0", (0.3, 0.0, 0.15), 0.4)


def table(robot, place, seed):
    """Return a Problem: from a posture above one end of a table with seven objects to one above the other end."""
    rng = np.random.default_rng((abs(seed), seed < 0, 1))
    s, (x, y, z) = place.size, place.centre
    things = [("table", Box((0.7 * s, 1.1 * s, 0.04 * s)), (x, y, z - 0.1 * s))]
    for k in range(7):
        at = (x + rng.uniform(-0.25, 0.25) * s, y + rng.uniform(-0.45, 0.45) * s)
        high = rng.uniform(0.08, 0.3) * s
        shape = Box((*(rng.uniform(0.04, 0.12, 2) * s), high)) if k % 2 else Cylinder(rng.uniform(0.02, 0.05) * s, high)
        things.append(("thing%d" % k, shape, (*at, z - 0.08 * s + 0.5 * high)))
    ends = [(x, y + side * 0.35 * s, z + 0.1 * s) for side in (-1.0, 1.0)]
    return _between("table %d" % seed, robot, place, things, ends, rng)


def shelf(robot, place, seed):
    """Return a Problem: from one compartment of a shelf with two by two of them into another."""
    rng = np.random.default_rng((abs(seed), seed < 0, 2))
    s, (x, y, z) = place.size, place.centre
    x += rng.uniform(0.0, 0.1) * s
    things = [("board%d" % k, Box((0.3 * s, 0.9 * s, 0.02 * s)), (x, y, z + (0.4 * k - 0.25) * s)) for k in range(3)]
    things += [("side%d" % k, Box((0.3 * s, 0.02 * s, 0.82 * s)), (x, y + (0.45 * k - 0.45) * s, z + 0.15 * s))
               for k in range(3)]
    cells = [(x - 0.08 * s, y + 0.225 * j * s, z + (0.4 * k - 0.05) * s) for j in (-1, 1) for k in (0, 1)]
    start, goal = rng.permutation(4)[:2]
    return _between("shelf %d" % seed, robot, place, things, (cells[start], cells[goal]), rng)


def _between(name, robot, place, things, ends, rng):
    scene = Scene(robot.model, allowed=_allowed(robot)).with_objects(
        [WorldObject(one, pose_matrix(at), ((shape, np.eye(4)),)) for one, shape, at in things])
    start, goal = (_posture(robot, scene, place, end, rng) for end in ends)
    return Problem(name, robot, scene, place.group, start, goal)


def _posture(robot, scene, place, target, rng):
    """Return a random posture, free by exact geometry, with the tip near ``target``; "near" widens until one exists."""
    model, group = robot.model, robot.model.groups[place.group]
    bounds = model.bounds[group.indices]
    near = 0.08 * place.size
    while True:
        for _ in range(3000):
            state = scene.state.with_q(rng.uniform(*bounds.T), group.indices)
            tip = model.frame_of(state.q, place.tip)[:3, 3]
            if np.linalg.norm(tip - target) < near and robot.exact.free(scene, state, group.name):
                return state.q[group.indices]
        near *= 1.2
