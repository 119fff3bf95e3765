#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Measure how an arm of profile:=robot feels and hits, and write docs/data/dynamics.csv, a table of docs/real_robot.md.

    ./baxter.sh sim python3 tests/bench/dynamics.py                # then tools/pages.py writes the page

Everything runs in this process, in lock-step: the same numbers on every machine. Rows that are not simulated, such as
published ones, stay in the file as they are.
"""
from __future__ import annotations

import datetime
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from baxter_lab import Lab, pose
from baxter_lab.lab import Options
from baxter_lab.robot import CommandRefused, Mode
from baxter_lab.tools import Tool
from baxter_model import JOINTS, poses
from baxter_sim_hardware.simulated import Which

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
TABLE = ROOT / "docs/data/dynamics.csv"
SIDE = "left"
NEUTRAL = np.array(list(poses().angles("neutral", SIDE).values()))
#: Ahead at the height of the shoulder, the elbow hardly bent.
STRETCHED = np.array([-0.785, 0.0, 0.0, 0.15, 0.0, -0.15, 0.0])
POSTURES = {"neutral": NEUTRAL, "stretched": STRETCHED}
LOAD_KG, LOAD_M = 1.0, 0.08
#: In torque mode a client has to know the weight; a loaded arm falls, so it is looked at for a shorter time.
HOLD_S = {Mode.POSITION: 8.0, Mode.RAW_POSITION: 8.0, Mode.VELOCITY: 2.0, Mode.TORQUE: 0.5}
WEIGHT = ('<robot name="weight"><link name="weight"><inertial><mass value="%g"/>'
          '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>')
SPEEDS, PUSHES_N, FEEL_RAD_S = (0.1, 0.25, 0.5), (10.0, 20.0), (0.1, 0.5)
AXES = {"ahead": 0, "to its left": 1, "up": 2}
Row = dict[str, str]


def made(gripper: str = "none", tools: tuple = (), effects: str = "lag,noise,safety") -> Lab:
    lab = Lab(Options(gripper, gripper, which=Which("robot", effects), with_meshes=False, tools=tools),
              warn=lambda text: None)
    lab.robot.enable()
    return lab


def stream(lab: Lab, mode: Mode, values: Any, seconds: float, each: Callable[[], None] = lambda: None) -> None:
    """Repeat a command 100 times a second; call `each` before each tick."""
    for number in range(round(seconds / lab.world.time_step_s)):
        if number % 5 == 0:
            lab.robot.arms[SIDE].command(mode, values)
        each()
        lab.step()


def at(lab: Lab, posture: np.ndarray) -> Any:
    """The arm at rest in a posture, held there."""
    lab.robot.put({SIDE: posture})
    lab.run(0.5)
    return lab.robot.arms[SIDE]


def row(part: str, what: str, figure: str, physical: str = "not published") -> Row:
    return {"part": part, "what": what, "here": figure, "physical robot": physical, "kind": "simulated",
            "source": "tests/bench/dynamics.py, %s" % datetime.date.today()}


def payload() -> Iterator[Row]:
    """How far a hand with a weight moves in each mode, by what the robot was told."""
    for told, kg in (("right", LOAD_KG), ("half of it", 0.5 * LOAD_KG), ("nothing", None)):
        for mode, seconds in HOLD_S.items():
            with made(tools=(Tool(SIDE, WEIGHT % LOAD_KG, (0.0, 0.0, LOAD_M)),)) as lab:
                arm = lab.robot.arms[SIDE]
                lab.robot.put({SIDE: STRETCHED})
                if kg is not None:
                    arm.gripper.command("configure", urdf={"name": "w", "link": [
                        {"name": "w", "inertial": {"mass": {"value": kg}, "origin": {"xyz": [0.0, 0.0, LOAD_M]}}}]})
                wanted = arm.chain.fk(STRETCHED)[:3, 3]
                still = np.zeros(len(JOINTS))
                values = STRETCHED if mode in (Mode.POSITION, Mode.RAW_POSITION) else still
                stream(lab, mode, values, seconds)
                yield row("payload", "%g kg, stretched, told %s: %s mode, after %g s" % (
                    LOAD_KG, told, mode.name.lower().replace("_", " "), seconds),
                    "%.0f mm down" % (1e3 * (wanted - arm.pose[:3, 3])[2]))


def stops() -> Iterator[Row]:
    """How far a hand goes on after the robot was disabled."""
    with made() as lab:
        for name, posture in POSTURES.items():
            for speed in (*SPEEDS, 1.0):
                arm = at(lab, posture)
                lever = np.linalg.norm(arm.pose[:2, 3] - arm.chain.joint_frames(posture)[1][0][:2])
                wanted = np.zeros(len(JOINTS))
                wanted[0] = speed / lever
                stream(lab, Mode.VELOCITY, wanted, 0.8)
                begin, time_s, way = arm.pose[:3, 3], lab.time_s, []
                lab.robot.disable()
                lab.wait(lambda way=way, arm=arm: way.append(arm.pose[:3, 3]) or np.abs(arm.velocities).max() < 0.02,
                         5.0, "rest")
                yield row("stopping", "hand at %g m/s by s0, %s: disabled" % (speed, name), "%.0f mm, %.2f s" % (
                    1e3 * max(np.linalg.norm(point - begin) for point in way), lab.time_s - time_s))
                lab.robot.enable()


def impacts() -> Iterator[Row]:
    """The force on a rigid wall that a hand hits."""
    for name, posture in POSTURES.items():
        for speed in SPEEDS:
            with made("electric") as lab:
                arm = at(lab, posture)
                place = arm.pose[:3, 3]
                radial = place - arm.chain.joint_frames(posture)[1][0]
                ahead = np.cross([0.0, 0.0, 1.0], radial)
                lever = np.linalg.norm(radial[:2])
                ahead /= np.linalg.norm(ahead)
                lab.add_box("wall", (0.1, 0.6, 0.6), place + 0.22 * ahead, yaw=float(np.arctan2(ahead[1], ahead[0])))
                forces, places, wanted = [], [], np.zeros(len(JOINTS))
                wanted[0] = speed / lever

                def note(lab: Lab = lab, arm: Any = arm, forces: list = forces, places: list = places) -> None:
                    places.append(arm.pose[:3, 3])
                    forces.append(sum(contact.force for contact in lab.world.contacts(lab.things["wall"].model)))

                try:
                    stream(lab, Mode.VELOCITY, wanted, 0.25 / speed + 0.6, note)
                except CommandRefused:  # it stands for 2 s after a collision
                    lab.run(0.3)
                touched = np.flatnonzero(np.array(forces) > 0.0)
                if not len(touched):
                    yield row("impact", "hand at %g m/s by s0 onto a rigid wall, %s" % (speed, name), "not reached")
                    continue
                first, tick = touched[0], lab.world.time_step_s
                after = np.array(forces[first:])
                met = np.linalg.norm(places[first] - places[first - 10]) / (10.0 * tick)
                yield row("impact", "hand told %g m/s by s0, onto a rigid wall, %s" % (speed, name),
                          "%.2f m/s at the wall; %.0f N at most, above 50 N for %.0f ms" % (
                              met, after.max(), 1e3 * tick * np.count_nonzero(after > 50.0)))


def pushes() -> Iterator[Row]:
    """How far a hand gives way to a push of a second, and what is left of it two seconds later."""
    with made() as lab:
        for name, posture in POSTURES.items():
            for direction, axis in AXES.items():
                found = []
                for newtons in PUSHES_N:
                    arm = at(lab, posture)
                    stream(lab, Mode.RAW_POSITION, posture, 1.0)
                    begin, force = arm.pose[:3, 3], np.zeros(3)
                    force[axis] = newtons
                    try:
                        stream(lab, Mode.RAW_POSITION, posture, 1.0,
                               lambda force=force: lab.robot.simulated.model.apply_wrench("%s_hand" % SIDE, force))
                    except CommandRefused:
                        found.append("%.0f N: counts as a collision, the arm stands for 2 s" % newtons)
                        continue
                    gave = 1e3 * (arm.pose[:3, 3] - begin)[axis]
                    stream(lab, Mode.RAW_POSITION, posture, 2.0)
                    found.append("%.0f N: %.0f mm, %.0f left" % (newtons, gave, 1e3 * (arm.pose[:3, 3] - begin)[axis]))
                yield row("push", "hand %s, %s" % (direction, name), "; ".join(found))


def floating() -> Iterator[Row]:
    """The force at the hand that keeps one joint of a floating arm turning."""
    with made() as lab:
        simulated = lab.robot.simulated
        simulated.guarding._is_squeezed = lambda side: side == SIDE
        for joint in ("s0", "s1", "e1"):
            found = []
            for speed in FEEL_RAD_S:
                arm = at(lab, NEUTRAL)
                index = JOINTS.index(joint)
                rotations, origins = arm.chain.joint_frames(NEUTRAL)
                axis, lever = rotations[index][:, 2], arm.pose[:3, 3] - origins[index]
                reach = np.linalg.norm(np.cross(axis, lever))
                state = {"torque": 0.0, "last": []}

                def push(arm: Any = arm, index: int = index, speed: float = speed, state: dict = state) -> None:
                    off = speed - arm.velocities[index]
                    state["torque"] = float(np.clip(state["torque"] + 0.1 * off, -40.0, 40.0))
                    rotations, origins = arm.chain.joint_frames(arm.angles)
                    around = rotations[index][:, 2]
                    away = arm.pose[:3, 3] - origins[index]
                    across = np.cross(around, away)
                    force = (state["torque"] + 40.0 * off) * across / np.dot(across, across)
                    simulated.model.apply_wrench("%s_hand" % SIDE, force)
                    state["last"].append(np.linalg.norm(force))

                for _ in range(round(2.0 / lab.world.time_step_s)):
                    push()
                    lab.step()
                found.append("%.1f N at %g rad/s (lever %.2f m)" % (np.mean(state["last"][-100:]), speed, reach))
            yield row("zero-g", "cuff squeezed, neutral, hand pushed across %s" % joint, "; ".join(found))


def gripping() -> Iterator[Row]:
    """How hard the fingers press, and what pulls a block out of them."""
    for percent in (30.0, 100.0):
        with made("electric") as lab:
            lab.add_box("table", (0.6, 1.2, 0.78), (0.8, 0.2, -0.54))
            block = lab.add_box("block", (0.04, 0.04, 0.08), (0.7, 0.3, -0.11), mass_kg=0.2)
            arm = lab.robot.arms[SIDE]
            arm.gripper.command("calibrate")
            lab.run(4.0)
            arm.gripper.command("configure", holding_force=percent, moving_force=percent)
            arm.gripper.open()
            arm.command(Mode.POSITION, arm.ik(pose((0.7, 0.3, 0.05))))
            lab.run(8.0)
            arm.command(Mode.POSITION, arm.ik(pose((0.7, 0.3, -0.10))))
            lab.run(5.0)
            arm.gripper.close()
            arm.command(Mode.POSITION, arm.ik(pose((0.7, 0.3, 0.10))))
            lab.run(5.0)
            pressed = sum(contact.force for contact in lab.world.contacts(block.model)) / 2.0
            held, pull = block.position - arm.pose[:3, 3], 0.0
            while pull < 100.0 and np.linalg.norm(block.position - arm.pose[:3, 3] - held) < 0.004:
                pull += 0.05
                block.model.apply_wrench("link", (0.0, 0.0, -pull))
                lab.step()
            yield row("gripper", "block of rubber tips' friction, force %g %%" % percent,
                      "%.0f N on each side; slips at a pull of %.0f N beside its weight" % (pressed, pull),
                      "35 N at most (the vendor's specification, from memory)")


PARTS = {"payload": payload, "stopping": stops, "impact": impacts, "push": pushes, "zero-g": floating,
         "gripper": gripping}


def main(names: list[str]) -> int:
    from pages import rows_of, write_rows
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        print("unknown part: %s; there are %s" % (", ".join(unknown), ", ".join(PARTS)), file=sys.stderr)
        return 2
    for name in names or PARTS:
        new = []
        for found in PARTS[name]():
            print("%(part)s | %(what)s | %(here)s" % found, flush=True)
            new.append(found)
        kept = [row for row in rows_of(TABLE) if not (row["kind"] == "simulated" and row["part"] == name)]
        order = [*PARTS, *(row["part"] for row in kept)]
        write_rows(TABLE, sorted(new + kept, key=lambda row: order.index(row["part"])))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
