# SPDX-License-Identifier: BSD-3-Clause
"""Fit the numbers of an arm's actuators to what it did, and say which of them the recording determines.

A number that the recording does not determine is not fitted: it keeps its value. What is left is fitted again.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baxter_model import JOINTS, joint_names
from baxter_sim_hardware import effects
from baxter_sim_hardware.arms.actuators import NUMBERS
from urdf_model import Robot

from . import fit as least
from .arm_body import ArmBody, Array, arm_body, hand_in_last, with_load
from .recording import COUNT_RAD, ArmRecording, start_of
from .replay import ReplayedMotion, replay, set_points

#: {number: (least, most, largest standard deviation with which it counts as determined: a share of it, or so much)}.
FREE = {"proportional_gain": (5.0, 1500.0, 0.3, 0.0), "motor_damping": (0.05, 300.0, 0.45, 0.0),
        "friction": (0.0, 8.0, 0.2, 0.25)}
EXCESS = ("counterbalance_excess", "s1")
#: Beside those of joints: the mass in the hand [kg], the way of a message to and fro [s].
MASS, DELAY = ("mass", "hand"), ("delay", "messages")
#: Torque that a joint's friction carries at the start, so that the controller's integral has it [Nm]. Where an arm came
#: from decides it, so it is fitted to tell it from the rest, and reported nowhere.
HELD = "held"
HELD_NM = 3.0
COMMON = {MASS: (0.0, 4.0, 0.2, 0.15), DELAY: (0.0, 0.06, 0.2, 0.003), EXCESS: (-0.5, 0.5, 0.2, 0.04)}
#: How much longer the latest message of a robot at hand takes than the earliest [s]: the effect `delay`.
JITTER_S = 0.003
#: The load's place on the hand's axis [m from the frame `<side>_hand`]: that of a gripper.
LOAD_M = 0.08
MAX_REFUSALS = 4
#: Whose jitter is the mean of an arm's errors over several draws, and that of its slopes in the last steps.
_DRAWS, _OTHER_DRAW = (1, 2, 3, 4), 5

Name = tuple[str, str]


class Settings(NamedTuple):
    """load: whether a mass in the hand is fitted; known: whether the controller was told of it (`configure`); delay:
    whether the way of messages is fitted; excess: whether s1's counterbalance is; given: [kg] a mass that is there;
    jitter_s: how much longer the latest messages take than the earliest."""

    load: bool = False
    known: bool = False
    delay: bool = False
    excess: bool = True
    given: float = 0.0
    jitter_s: float = 0.0


class IdentifiedNumbers(NamedTuple):
    """names (p,) of the fitted numbers, values and deviations (p,); refused: {name: deviation} of those that the
    recording does not determine; before, after, without (rows, arms, 7) [rad]: simulated less recorded, with the
    numbers as they were, as fitted, and, in each block of time, as fitted without it; motions: of each arm, after;
    numbers (k, 7): of the actuators."""

    sides: tuple[str, ...]
    names: list[Name]
    values: Array
    deviations: Array
    refused: dict[Name, float]
    before: Array
    after: Array
    without: Array
    motions: list[ReplayedMotion]
    numbers: dict[str, Array]

    def value(self, name: Name, default: float = 0.0) -> float:
        """The fitted value of a number, or `default`."""
        return float(self.values[self.names.index(name)]) if name in self.names else default


class _Arm(NamedTuple):
    side: str
    body: ArmBody
    hand: Array
    numbers: Array
    start: tuple[Array, Array]
    commanded: Array
    sensed: Array


class FittedModel:
    """Arms that share the numbers that are fitted, and their recording.

    rows: section "lag" of `effects.read`. Raises SysidError for a description that is no Baxter's.
    """

    def __init__(self, robot: Robot, rows: dict, recording: ArmRecording, sides: tuple[str, ...],
                 settings: Settings) -> None:
        self.settings, self._period = settings, recording.period_s
        self.arms = [_Arm(side, arm_body(robot, side), hand_in_last(robot, side),
                          np.array([effects.per_joint(rows, number, joint_names(side)) for number in NUMBERS]),
                          start_of(recording.sensed[side], self._period, recording.commanded[side]),
                          recording.commanded[side], recording.sensed[side]) for side in sides]

    def names(self) -> list[Name]:
        """Of all numbers that may be fitted."""
        settings = self.settings
        common = [name for name, is_free in ((EXCESS, settings.excess), (MASS, settings.load), (DELAY, settings.delay))
                  if is_free]
        held = [(HELD, joint) for arm in self.arms for joint in joint_names(arm.side)]
        return [(number, joint) for number in FREE for joint in JOINTS] + held + common

    def start(self, names: list[Name]) -> Array:
        """(p,) the numbers as they are."""
        first = self.arms[0].numbers
        return np.array([{MASS: 0.5, DELAY: 0.01}.get(name, 0.0) if name[0] not in NUMBERS
                         else first[NUMBERS.index(name[0]), JOINTS.index(name[1])] for name in names])

    def numbers(self, arm: _Arm, names: list[Name], values: Array) -> Array:
        """(k, 7) of one arm's actuators."""
        numbers = arm.numbers.copy()
        for (number, joint), value in zip(names, values, strict=True):
            if number in NUMBERS:
                numbers[NUMBERS.index(number), JOINTS.index(joint)] = value
        return numbers

    def motions(self, names: list[Name], values: Array, draw: int = 0) -> list[ReplayedMotion]:
        """The motion of the arms with these numbers; draw: of the jitter."""
        common = dict(zip(names, values, strict=True))
        mass, found = float(common.get(MASS, self.settings.given)), []
        for arm in self.arms:
            loaded = with_load(arm.body, mass, arm.hand[:3, :3] @ [0.0, 0.0, LOAD_M] + arm.hand[:3, 3])
            points = set_points(arm.commanded, self._period, float(common.get(DELAY, 0.0)), self.settings.jitter_s,
                                draw)
            held = np.array([common.get((HELD, joint), 0.0) for joint in joint_names(arm.side)])
            found.append(replay(loaded, loaded if self.settings.known else arm.body, self.numbers(arm, names, values),
                                (*arm.start, held), points, self._period))
        return found

    def errors(self, names: list[Name], values: Array, draws: tuple[int, ...] = (0,)) -> Array:
        """(rows, arms * 7) [rad] simulated less recorded, the mean over `draws` of the jitter."""
        return np.mean([np.concatenate([motion.position - arm.sensed for motion, arm in zip(
            self.motions(names, values, draw), self.arms, strict=True)], axis=1) for draw in draws], axis=0)


def identify(model: FittedModel) -> IdentifiedNumbers:
    """Fit a model's numbers."""
    names, refused = model.names(), {}
    before = model.errors([], np.zeros(0))
    for _ in range(MAX_REFUSALS):
        start = model.start(names)
        bounds = _bounds(names, start)

        def errors(values: Array, names: list[Name] = names) -> Array:
            return model.errors(names, values)

        found = least.least_squares(errors, start, bounds)
        if model.settings.jitter_s:
            found = found._replace(deviation=_with_jitter(names, found))
        vague = _vague(names, found)
        if not vague.any():
            break
        refused.update({name: float(deviation) for name, deviation, is_vague in zip(
            names, found.deviation, vague, strict=True) if is_vague})
        names = [name for name, is_vague in zip(names, vague, strict=True) if not is_vague]
    if model.settings.jitter_s:
        found = least.instrumented(lambda values: model.errors(names, values, _DRAWS),
                                   lambda values: model.errors(names, values, (_OTHER_DRAW,)), found, bounds)
        found = found._replace(deviation=_with_jitter(names, found))
    without = found.error.copy()
    others = _left_out(model, names, found, bounds)
    for number, block in enumerate(least.block_slices(len(without))):
        without[block] = others[number][block]
    shape = (len(without), len(model.arms), len(JOINTS))
    return IdentifiedNumbers(tuple(arm.side for arm in model.arms), names, found.numbers, found.deviation, refused,
                             before.reshape(shape), found.error.reshape(shape), without.reshape(shape),
                             model.motions(names, found.numbers),
                             {arm.side: model.numbers(arm, names, found.numbers) for arm in model.arms})


def _left_out(model: FittedModel, names: list[Name], found: least.Fit, bounds: least.FitBounds) -> Array:
    """`fit.left_out` of a model. What friction held at the start is kept: other blocks of time say nothing of it."""
    free = np.array([name[0] != HELD for name in names])

    def errors(values: Array) -> Array:
        whole = found.numbers.copy()
        whole[free] = values
        return model.errors(names, whole, _DRAWS if model.settings.jitter_s else (0,))

    part = least.Fit(found.numbers[free], found.error, found.slopes[free], found.deviation[free])
    return least.left_out(errors, part, least.FitBounds(*(each[free] for each in bounds)))


def _with_jitter(names: list[Name], found: least.Fit) -> Array:
    """(p,) standard deviations where commands come with jitter: a set-point that waits for a late command looks like
    rest to the controller, whose integral then takes some of the friction, up to a count of the sensor by the gain."""
    deviation = found.deviation.copy()
    for index, (number, joint) in enumerate(names):
        gain = ("proportional_gain", joint)
        if number == "friction" and gain in names:
            deviation[index] = np.hypot(deviation[index], COUNT_RAD * found.numbers[names.index(gain)])
    return deviation


def _limits(name: Name) -> tuple[float, float, float, float]:
    if name[0] == HELD:
        return -HELD_NM, HELD_NM, 0.0, 1e9
    return COMMON[name] if name in COMMON else FREE[name[0]]


def _bounds(names: list[Name], start: Array) -> least.FitBounds:
    limits = np.array([_limits(name)[:2] for name in names])
    steps = np.where([name[0] == HELD for name in names], 0.02, np.maximum(0.02 * np.abs(start), 2e-3))
    return least.FitBounds(limits[:, 0], limits[:, 1], steps)


def _vague(names: list[Name], found: least.Fit) -> NDArray[np.bool_]:
    """(p,) which numbers are not determined. Of a joint's gain and damping the vaguer one goes first: often only
    their ratio, the joint's lag, is determined."""
    limits = np.array([_limits(name)[2:] for name in names])
    ratio = found.deviation / np.maximum(limits[:, 0] * np.abs(found.numbers), np.maximum(limits[:, 1], 1e-9))
    vague = ratio > 1.0
    for joint in JOINTS:
        own = [index for index, name in enumerate(names) if name[1] == joint and name[0] in FREE and vague[index]]
        for index in own:
            vague[index] = index == max(own, key=lambda one: ratio[one])
    return vague


def table_of(table: dict, found: IdentifiedNumbers, source: str) -> dict:
    """A copy of the YAML table of physical_robot.yaml in which the fitted numbers are an arm's own."""
    lag = {number: {**row, "values": dict(row["values"])} for number, row in table["lag"].items()}
    for number, joint in found.names:
        if number not in NUMBERS:
            continue
        for side in found.sides:
            lag[number]["values"]["%s_%s" % (side, joint)] = float(
                "%.5g" % found.numbers[side][NUMBERS.index(number), JOINTS.index(joint)])
        lag[number].update(grade="fitted", source=source)
    return {**table, "lag": lag}


