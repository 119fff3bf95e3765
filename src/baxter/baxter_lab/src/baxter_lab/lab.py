# SPDX-License-Identifier: BSD-3-Clause
"""The front door: a world with Baxter in it, in this process.

Everything is in the robot's frame `base`: x ahead, y to its left, z up; the floor is 0.93 m below. SI units, radians.
"""
from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baxter_model import BASE_HEIGHT_M, SIDES, poses
from baxter_model.self_collision import spawn_options
from baxter_sim_hardware import compiled
from baxter_sim_hardware.simulated import SimulatedBaxter, Which
from baxter_sim_hardware.warnings import Warnings
from bullet_sim import Pose, World
from bullet_sim.solids import with_solids
from urdf_model import (
    Box,
    Cylinder,
    Inertial,
    Link,
    Plane,
    Robot,
    Shape,
    Sphere,
    Surface,
    description_text,
    parse_urdf,
)

from .cameras import LabCameras
from .descriptions import baxter_urdf
from .errors import LabError, NotReached
from .meshes import MeshFinder, mesh_folder
from .planning import FLOOR, LabPlanner
from .robot import MOVE_S, Baxter
from .saving import SavedState
from .tools import with_tools

if TYPE_CHECKING:
    from bullet_sim import Model
    from motion_planning.timing import Timed

LOG = logging.getLogger("baxter_lab")
STEP_S = 0.002
ROBOT = "baxter"


class _Log:
    """Where repeated warnings of the robot's logic go."""

    @staticmethod
    def warn(text: str) -> None:
        LOG.warning(text)


class Options(NamedTuple):
    """left_gripper, right_gripper: "electric", "suction" or "none"; pedestal, kinect: whether there is one; pose: that
    the arms start in, by its name in `baxter_model`; which: whether it behaves as a physical one, and which one;
    with_meshes: False puts boxes in the place of all of the robot's meshes, which loads faster and needs no files;
    tools: what is fixed to its hands, each a `Tool`."""

    left_gripper: str = "electric"
    right_gripper: str = "electric"
    pedestal: bool = True
    kinect: bool = False
    pose: str = "neutral"
    which: Which = Which()
    with_meshes: bool = True
    tools: tuple = ()

    def arguments(self) -> dict[str, str]:
        """Those of the robot's xacro file."""
        return {"left_gripper": self.left_gripper, "right_gripper": self.right_gripper,
                "pedestal": str(self.pedestal).lower(), "kinect": str(self.kinect).lower()}


class Thing:
    """An object in the world. Attributes: `model`, of bullet_sim; `name`; `shape`, of urdf_model, or None."""

    def __init__(self, model: Model, shape: Box | Cylinder | Sphere | None = None) -> None:
        self.model, self.name, self.shape = model, model.name, shape

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) where it is."""
        return self.model.base_pose().matrix()

    @property
    def position(self) -> np.ndarray:
        """(3,) [m]."""
        return np.array(self.model.base_pose().position)

    def put(self, place: npt.ArrayLike, yaw: float = 0.0) -> None:
        """Put it at a pose (4, 4), or at (x, y, z), turned about the vertical, at rest."""
        self.model.set_base_pose(_pose(place, yaw))
        if not self.model.static:
            self.model.set_base_twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def __repr__(self) -> str:
        return "%s at (%.3f, %.3f, %.3f)" % (self.name, *self.position)


def _pose(place, yaw=0.0):
    place = np.asarray(place, dtype=float)
    if place.shape == (4, 4):
        return Pose.from_matrix(place)
    if place.shape != (3,):
        raise LabError("a place is a pose (4, 4) or (x, y, z); found an array %s" % (place.shape,))
    return Pose(tuple(place.tolist()), (0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)))


def pose(place: Sequence[float], rpy: Sequence[float] = (math.pi, 0.0, 0.0)) -> np.ndarray:
    """(4, 4) the pose at (x, y, z) with roll, pitch and yaw [rad]; by default of a hand that points straight down."""
    from urdf_model.transforms import pose_matrix

    return pose_matrix(place, rpy)


class Lab:
    """A world with a floor and Baxter. Use it in one thread; `close` it, or use it in a ``with``.

    options: `Options`; seed: of all chance in it; time_step_s: of a tick [s]; warn: gets each warning, of the world and
    of the robot, by default the log "baxter_lab". The same calls give the same numbers, bit for bit, in every fresh
    Lab on one machine. Raises MeshesMissing where the robot's meshes are not here and cannot be fetched: nothing takes
    their place unasked. Attributes: `world`, of bullet_sim; `robot`, a Baxter, disabled at first; `cameras`.
    """

    def __init__(self, options: Options = Options(), seed: int = 0, time_step_s: float = STEP_S,  # noqa: B008
                 warn: Callable[[str], None] = LOG.warning):
        compiled.load()
        self.options, self._warn, self._hooks = options, warn, []
        self.find_mesh = MeshFinder(mesh_folder()) if options.with_meshes else lambda name: None
        self.robot_urdf = with_tools(baxter_urdf(options.arguments()), options.tools)
        self.world = World(time_step_s=time_step_s, seed=seed, find_mesh=self.find_mesh,
                           warn=warn if options.with_meshes else lambda text: None)
        self.things: dict[str, Thing] = {}
        self.forgotten_states: list[int] = []
        self._spawn(FLOOR, Plane(), (0.0, 0.0, -BASE_HEIGHT_M), 0.0, ThingProperties(colour=(0.75, 0.77, 0.80, 1.0)))
        self.robot = self._spawn_robot()
        self.world._warn = warn  # of objects that come later
        self.cameras = LabCameras(self)
        self._planning = LabPlanner(self)

    def _spawn_robot(self):
        described = parse_urdf(self.robot_urdf, source=ROBOT)
        choices = spawn_options(described.links)
        model = self.world.spawn(with_solids(described, choices.pop("solids")), ROBOT, Pose(), static=True, **choices)
        table = poses()
        for side in SIDES:
            angles = table.angles(self.options.pose, side)
            model.set_joint_positions(model.index(list(angles)), np.array(list(angles.values())))
        simulated = SimulatedBaxter(self.world, model, described, self.options.which)
        simulated.guarding.warn = Warnings(_Log()).warn
        return Baxter(simulated, self.wait)

    def __enter__(self) -> Lab:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def close(self) -> None:
        """End the world. A second call does nothing."""
        self.cameras.close()
        self.world.close()

    # -- time

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return self.world.time_s

    def step(self) -> None:
        """One tick: the robot's control logic, then the physics."""
        simulated, time_s = self.robot.simulated, self.world.time_s
        for before in self._hooks:
            before(time_s)
        simulated.measure(time_s, time_s)
        simulated.update()
        self.world.step()

    def each_tick(self, function: Callable[[float], None]) -> None:
        """Call ``function(time_s)`` at the start of every tick, as for a controller that streams commands."""
        self._hooks.append(function)

    def run(self, seconds: float) -> None:
        """Let so much simulated time pass."""
        for _ in range(round(seconds / self.world.time_step_s)):
            self.step()

    def wait(self, condition: Callable[[], bool], within_s: float = MOVE_S, what: str = "the condition") -> None:
        """Step until ``condition()`` is true. Raises NotReached after so much simulated time."""
        end = self.world.time_s + within_s
        while not condition():
            if self.world.time_s >= end:
                raise NotReached("not reached within %g s of simulation: %s" % (within_s, what))
            self.step()

    def save(self) -> SavedState:
        """The state of everything, to ``restore``; bodies that rest stay awake from the first call on.

        What follows is what follows each ``restore``, bit for bit; without the call it may differ in the last digits.
        """
        return SavedState(self)

    def restore(self, state: SavedState) -> None:
        """Return to a saved state: the same calls then give the same numbers, bit for bit. Raises LabError for the
        state of another lab, and where objects have been added or removed since."""
        if not isinstance(state, SavedState) or not state.is_of(self):
            found = "one of another lab" if isinstance(state, SavedState) else repr(state)
            raise LabError("a lab returns to states of its own save(); found " + found)
        if not state.restore():
            raise LabError("objects were added or removed since the state was saved; it fits the world no more")

    # -- things

    def _spawn(self, name, geometry, place, yaw, body):
        shape = Shape(geometry, np.eye(4), "shape", body.colour, "link")
        link = Link("link", collisions=[shape], visuals=[shape])
        if body.mass_kg is not None:
            link.inertial = Inertial(body.mass_kg, np.zeros(3), _inertia(geometry, body.mass_kg))
        if body.friction is not None:
            link.surface = Surface(friction=body.friction)
        model = self.world.spawn(Robot(name, {"link": link}, {}, "link"), name, _pose(place, yaw),
                                 static=body.mass_kg is None)
        self.things[name] = Thing(model, geometry)
        return self.things[name]

    def add_box(self, name: str, size: Sequence[float], place: npt.ArrayLike, yaw: float = 0.0, **body: Any) -> Thing:
        """Add a box of `size` (3,) [m] with its centre at `place`: a pose (4, 4), or (x, y, z) and `yaw` [rad].

        It is fixed unless it has a `mass_kg`; `friction`, `colour`: as in `ThingProperties`. Raises BulletSimError for
        a name that is taken, and for numbers out of bounds.
        """
        x, y, z = map(float, size)
        return self._spawn(name, Box((x, y, z)), place, yaw, ThingProperties(**body))

    def add_cylinder(self, name: str, radius: float, length: float, place: npt.ArrayLike, yaw: float = 0.0,
                     **body: Any) -> Thing:
        """Add a cylinder along z; otherwise as `add_box`."""
        return self._spawn(name, Cylinder(radius, length), place, yaw, ThingProperties(**body))

    def add_sphere(self, name: str, radius: float, place: npt.ArrayLike, **body: Any) -> Thing:
        """Add a ball; otherwise as `add_box`."""
        return self._spawn(name, Sphere(radius), place, 0.0, ThingProperties(**body))

    def add_urdf(self, name: str, description: str | Path, place: npt.ArrayLike, yaw: float = 0.0,
                 static: bool | None = None) -> Thing:
        """Add what a URDF text, or a file with one, describes, its root's frame at `place`. `static`: whether it is
        fixed; by default only a root called "world" is. A mesh that is not found is replaced with a warning."""
        text = description_text(description) if isinstance(description, Path) else description
        model = self.world.spawn(parse_urdf(text, source=name), name, _pose(place, yaw), static)
        self.things[name] = Thing(model)
        return self.things[name]

    def remove(self, name: str) -> None:
        """Take an object out of the world. Raises BulletSimError where there is none of that name."""
        if name == ROBOT:
            raise LabError("the robot stays; only objects that were added can be removed")
        self.world.delete(name)
        self.things.pop(name, None)

    # -- motions that avoid the things

    def plan(self, side: str, goal: np.ndarray, held: str | None = None, time_limit_s: float = 5.0,
             seed: int = 0) -> Timed:
        """A timed path of one arm to a pose (4, 4) or angles (7,) around all things of simple shapes.

        `held`: name of the thing in its hand. Returns a `motion_planning.timing.Timed` for `follow`. Raises
        NoPath and NoSolution, which say what is in the way.
        """
        return self._planning.plan(side, goal, held, time_limit_s, seed)

    def follow(self, side: str, timed: Timed) -> None:
        """Move one arm along a timed path, and wait for its end. Raises CommandRefused, NotReached."""
        self._planning.follow(side, timed)


class ThingProperties(NamedTuple):
    """mass_kg: None for what is fixed; friction: None for the world's usual; colour: red, green, blue, opacity."""

    mass_kg: float | None = None
    friction: float | None = None
    colour: tuple = (0.72, 0.45, 0.25, 1.0)


def _inertia(geometry, mass):
    """(3, 3) of a homogeneous body about its centre [kg m^2]."""
    if isinstance(geometry, Box):
        x, y, z = (side * side for side in geometry.size)
        return np.diag([y + z, x + z, x + y]) * mass / 12.0
    if isinstance(geometry, Cylinder):
        across = 3.0 * geometry.radius**2 + geometry.length**2
        return np.diag([across, across, 6.0 * geometry.radius**2]) * mass / 12.0
    return np.eye(3) * 0.4 * mass * geometry.radius**2
