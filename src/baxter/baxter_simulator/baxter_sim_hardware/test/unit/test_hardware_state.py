# SPDX-License-Identifier: BSD-3-Clause
"""Every row of the enable/stop/reset table, and what each state puts on the wire."""
import contextlib
import subprocess
import sys
from pathlib import Path

import pytest

from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.robot_state import BaxterState, Event, RobotState

SOURCE = Path(__file__).resolve().parents[2] / "src" / "baxter_sim_hardware"
# Written out independently of the code: (state, event, state after, is a refusal).
ROWS = """
disabled enable enabled -
disabled disable disabled -
disabled stop stopped -
disabled reset disabled -
disabled press pressed -
disabled release disabled -
enabled enable enabled -
enabled disable disabled -
enabled stop stopped -
enabled reset disabled -
enabled press pressed -
enabled release enabled -
stopped enable stopped refused
stopped disable stopped -
stopped stop stopped -
stopped reset disabled -
stopped press pressed -
stopped release stopped -
pressed enable pressed refused
pressed disable pressed -
pressed stop pressed -
pressed reset pressed refused
pressed press pressed -
pressed release released -
released enable released refused
released disable released -
released stop released -
released reset disabled -
released press pressed -
released release released -
failed enable failed refused
failed disable failed -
failed stop failed -
failed reset disabled -
failed press failed -
failed release failed -
"""
STATES = {"disabled": BaxterState.DISABLED, "enabled": BaxterState.ENABLED, "stopped": BaxterState.STOPPED,
          "pressed": BaxterState.ESTOP_PRESSED, "released": BaxterState.ESTOP_RELEASED, "failed": BaxterState.FAILED}
EVENTS = {"enable": Event.ENABLE, "disable": Event.DISABLE, "stop": Event.STOP, "reset": Event.RESET,
          "press": Event.ESTOP_PRESS, "release": Event.ESTOP_RELEASE}


@pytest.mark.parametrize("row", ROWS.strip().splitlines())
def test_transition(row):
    before, event, after, refused = row.split()
    robot = RobotState(STATES[before])
    with pytest.raises(CommandRefused) if refused == "refused" else contextlib.nullcontext():
        robot.apply(EVENTS[event])
    assert robot.state is STATES[after]


def test_every_pair_has_a_row():
    assert len(ROWS.strip().splitlines()) == len(BaxterState) * len(Event)


@pytest.mark.parametrize("name, fields", [  # ready enabled stopped error estop_button estop_source
    ("disabled", (False, False, False, False, 0, 0)),
    ("enabled", (True, True, False, False, 0, 0)),
    ("stopped", (False, False, True, False, 2, 2)),
    ("pressed", (False, False, True, False, 1, 1)),
    ("released", (False, False, True, False, 3, 1)),
    ("failed", (False, False, True, True, 0, 3)),
])
def test_wire_fields(name, fields):
    assembly = RobotState(STATES[name]).assembly
    assert (assembly.ready, assembly.enabled, assembly.stopped, assembly.error,
            int(assembly.estop_button), int(assembly.estop_source)) == fields


def test_refusal_says_what_to_do():
    robot = RobotState(BaxterState.STOPPED)
    with pytest.raises(CommandRefused, match="reset it first"):
        robot.apply(Event.ENABLE)


def test_what_needs_power_is_refused_in_every_other_state():
    RobotState(BaxterState.ENABLED).require_enabled()
    for state in set(BaxterState) - {BaxterState.ENABLED}:
        with pytest.raises(CommandRefused, match="not enabled"):
            RobotState(state).require_enabled()


def test_stop_has_the_last_word_of_a_tick():
    assert list(Event).index(Event.STOP) > list(Event).index(Event.ENABLE) > list(Event).index(Event.RESET)


CORE = sorted(path.relative_to(SOURCE).with_suffix("").as_posix().replace("/", ".")
              for path in SOURCE.rglob("*.py") if path.stem not in ("__init__", "__main__", "plugin")
              and path.parent.name != "topics")


def test_core_loads_without_ros():
    """Everything but the plugin and the topics must import on a machine that has no ROS at all."""
    assert {"robot_state", "arms.control", "grippers.electric", "sensing.panel"} < set(CORE)
    ros = ("rospy", "roslib", "genpy", "std_msgs", "sensor_msgs", "geometry_msgs", "baxter_core_msgs", "gazebo_ros")
    code = ("import importlib, sys; sys.modules.update(dict.fromkeys(%r))\n"
            "for name in %r: importlib.import_module('baxter_sim_hardware.' + name)" % (ros, CORE))
    subprocess.run([sys.executable, "-c", code], check=True)
