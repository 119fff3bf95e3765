# SPDX-License-Identifier: BSD-3-Clause
"""Grippers in the physics world: each connects a gripper's core with the bodies that it moves and touches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from baxter_model import tip_of
from baxter_model.description import cup_of, openings_of

from .commands import CustomGripperHardware
from .electric import OPEN, ElectricGripperHardware
from .suction import SuctionGripperHardware

if TYPE_CHECKING:
    from collections.abc import Mapping

    from bullet_sim import Model, World

RIM_RAYS = 8  # that look for a surface around the rim of the cup, and one in its middle
RIM_SHARE = 0.8  # of the cup's radius, at which they do
INSIDE_M, LIP_M = 0.002, 0.003  # they begin so far inside the cup; its lip bridges a gap of so much
LOOK_TICKS = 5  # how often fingers at rest are looked at: whether somebody moves them


class FingersHand:
    """The electric gripper of one side: two finger joints that move as one, as on a common pinion.

    world, model: of bullet_sim; openings: {finger joint: where it is open [m]}; dt: length of a tick [s]; calibrated:
    whether it is, at the start.
    Attribute `gripper`: its core.
    """

    def __init__(self, world: World, model: Model, side: str, openings: Mapping[str, float], dt: float,
                 calibrated: bool = True) -> None:
        self._world, self._model = world, model
        self._index = model.index(openings)
        self._openings = np.array(list(openings.values()))
        self._weights = [(index, 1.0 / (opening * len(openings)))
                         for index, opening in zip(self._index.tolist(), openings.values(), strict=True)]
        self._max_effort = model.max_effort[self._index]
        self._links = [model.robot.joints[name].child for name in openings]
        self._tip = tip_of(side)
        for first, second in zip(self._index, self._index[1:], strict=False):
            model.couple(first, second, self._openings[1] / self._openings[0])
        for link in self._links:
            model.grip_firmly(link)
        self.gripper = ElectricGripperHardware(float(np.abs(self._openings).max()), self._position(), dt, calibrated)
        self._unseen_ticks = 0
        self._driven = OPEN, 100.0  # to which share of the travel, how hard [%], as they begin

    def opening(self, positions: np.ndarray) -> float:
        """How far it is open [%]; positions: of all joints of the model."""
        return 100.0 * min(max(self._share(positions), 0.0), 1.0)

    def readings(self, positions: np.ndarray) -> tuple[float, float]:
        """(opening, force) [%] for the state message; positions: of all joints of the model."""
        return self.opening(positions), min(self._squeeze(), 100.0)

    def _squeeze(self) -> float:
        """Force on the fingers along their travel, the mean of both [% of the joints' effort limit]."""
        forces = [force for link in self._links if (force := self._model.contact_force(link)).any()]
        if not forces:
            return 0.0  # mostly, and the pose below costs more than all else in a state message
        along = self._model.link_pose(self._tip).matrix()[:3, 1]
        return 100.0 * sum(abs(float(force @ along)) for force in forces) / float(self._max_effort.sum())

    def update(self, joints: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """One tick; joints: (position, velocity, effort) of the whole model."""
        self._unseen_ticks += 1
        if self.gripper.resting and self._unseen_ticks < LOOK_TICKS:
            return
        self._unseen_ticks = 0
        drive = self.gripper.update(self._share(joints[0]), self._squeeze)
        if drive is None:
            return
        if self.gripper.hooked:
            # After two edges were parallel, Bullet may keep a contact with a wrong normal, which keeps the fingers from
            # opening.
            self._world.renew_contacts(self._model, self._links)
        self._driven = drive
        self.drive_again()

    def drive_again(self) -> None:
        """Send the fingers where they were sent last."""
        setpoint, force = self._driven
        self._model.drive_position(self._index, setpoint * self._openings, force / 100.0 * self._max_effort)

    def stop(self) -> None:
        """The robot was disabled."""
        self.gripper.stop(self._position())

    def reset(self) -> None:
        """The world went back to its start, or the joints were put elsewhere."""
        self.gripper.reset(self._position())

    def _position(self) -> float:
        return self._share(self._model.read_joints()[0])

    def _share(self, values: np.ndarray) -> float:
        # Runs at every tick: numpy's sum would take ten times as long.
        share = 0.0
        for index, weight in self._weights:
            share += values.item(index) * weight
        return share


class CupHand:
    """The suction gripper of one side: a cup that is pressed by its vacuum against the object on it.

    world, model: of bullet_sim; cup: (frame at the rim, radius [m]). The frame's z axis points out of the cup.
    Attribute `gripper`: its core.
    """

    def __init__(self, world: World, model: Model, cup: tuple[str, float], dt: float) -> None:
        self._world, self._model = world, model
        self._frame, radius = cup
        self._area_m2 = np.pi * radius**2
        angles = 2.0 * np.pi * np.arange(RIM_RAYS) / RIM_RAYS
        ring = RIM_SHARE * radius * np.array([np.cos(angles), np.sin(angles), 0.0 * angles]).T
        self._ring = np.vstack([ring, np.zeros(3)])
        model.grip_firmly(self._frame)
        self.gripper = SuctionGripperHardware(dt)

    def opening(self, positions: np.ndarray) -> float:
        """How far it is open [%]."""
        return 0.0

    def readings(self, positions: np.ndarray) -> tuple[float, float]:
        """(opening, force) [%] for the state message: a cup has neither."""
        return 0.0, 0.0

    def _covering(self) -> tuple[str, str] | None:
        """(model, link), names of the body that covers the whole cup within reach of the lip, or None."""
        pose = self._model.link_pose(self._frame).matrix()
        starts = (self._ring - (0.0, 0.0, INSIDE_M)) @ pose[:3, :3].T + pose[:3, 3]
        ends = starts + (INSIDE_M + LIP_M) * pose[:3, 2]
        met = set(self._world.first_hits(starts.tolist(), ends.tolist()))
        # Sometimes a ray hits the cup's own shape.
        met -= {met_here for met_here in met if met_here is not None and met_here[0] == self._model.name}
        return met.pop() if len(met) == 1 else None

    def update(self, joints: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """One tick."""
        if self.gripper.idle:
            return
        covering = self._covering()
        pressure = self.gripper.update(covering is not None)
        if covering is None:
            return
        model, link = covering
        pose = self._model.link_pose(self._frame)
        force = pressure * self._area_m2 * pose.matrix()[:3, 2]
        self._world.models[model].apply_wrench(link, force, position=pose.position)
        self._model.apply_wrench(self._frame, -force, position=pose.position)

    def drive_again(self) -> None:
        """A cup goes nowhere."""

    def stop(self) -> None:
        """The robot was disabled."""
        self.gripper.end_attempt()

    def reset(self) -> None:
        """The world went back to its start, or the joints were put elsewhere."""
        self.gripper.reset()


class NoHand:
    """An arm without a gripper, or with a tool that moves nothing.

    Attribute `gripper`: its core.
    """

    def __init__(self) -> None:
        self.gripper = CustomGripperHardware()

    def opening(self, positions: np.ndarray) -> float:
        """How far it is open [%]."""
        return 0.0

    def readings(self, positions: np.ndarray) -> tuple[float, float]:
        """(opening, force) [%] for the state message."""
        return 0.0, 0.0

    def update(self, joints: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """One tick."""

    def drive_again(self) -> None:
        """Nothing here goes anywhere."""

    def stop(self) -> None:
        """The robot was disabled."""

    def reset(self) -> None:
        """The world went back to its start, or the joints were put elsewhere."""
        self.gripper.forget()


def hand_of(world: World, model: Model, side: str, dt: float,
            calibrated: bool = True) -> FingersHand | CupHand | NoHand:
    """The hand of one arm in the description, an object of one of the classes above; calibrated: whether an electric
    gripper is, at the start."""
    openings, cup = openings_of(model.robot, side), cup_of(model.robot, side)
    if openings:
        return FingersHand(world, model, side, openings, dt, calibrated)
    return CupHand(world, model, cup, dt) if cup else NoHand()
