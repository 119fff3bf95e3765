# SPDX-License-Identifier: BSD-3-Clause
"""The gripper action server's commands to a gripper, and when a goal is reached."""
import pytest

from baxter_interface import parameter_tables
from gripper_action.gripper_action import LONG_SUCTION_S, STEPS_TO_BEGIN, _Electric, _Suction

SETTINGS = {parameter.name[len("left_gripper_"):]: parameter.default for parameter in parameter_tables.GRIPPER
            if parameter.name.startswith("left_gripper_")}


class FakeGripper:
    def __init__(self, **readings):
        flags = ("gripping", "moving", "sucking", "blowing")
        self.readings = {"position": 0.0, "force": 0.0, "vacuum_sensor": 0.0, **dict.fromkeys(flags, False), **readings}
        self.sent = []
        self.told = {}

    def __getattr__(self, name):
        return lambda: self.readings[name]

    def parameters(self):
        return dict(self.told)

    def set_parameters(self, parameters):
        self.sent.append("configure")
        self.told.update(parameters)

    def command_position(self, position, block):
        self.sent.append(("go", position))

    def open(self, block):
        self.sent.append("open")

    def close(self, block, timeout):
        self.sent.append(("close", timeout))


@pytest.mark.parametrize("asked, force", [(0.0, 40.0), (-1.0, 100.0), (55.0, 55.0), (250.0, 100.0)])
def test_effort_is_the_moving_force(asked, force):
    gripper = FakeGripper()
    _Electric(gripper, SETTINGS, 50.0, asked).push()
    assert gripper.told == {"velocity": 50.0, "moving_force": force, "holding_force": 30.0, "dead_zone": 5.0}


def test_electric_is_configured_once_and_commanded_each_time():
    gripper = FakeGripper()
    action = _Electric(gripper, SETTINGS, 120.0, 0.0)
    action.push()
    action.push()
    assert gripper.sent == ["configure", ("go", 100.0), ("go", 100.0)]


@pytest.mark.parametrize("readings, stalled, reached", [
    ({"position": 30.0, "force": 10.0}, False, False),
    ({"position": 52.0}, False, True),
    ({"position": 30.0, "force": 41.0}, True, False),
    ({"position": 70.0, "gripping": True}, True, False),
    ({"position": 70.0, "gripping": True, "moving": True}, False, False),
    ({"position": 30.0, "gripping": True}, False, False),  # It opens, and has not let go yet.
])
def test_electric_ends_at_the_position_or_stalled(readings, stalled, reached):
    action = _Electric(FakeGripper(**readings), SETTINGS, 50.0, 0.0)
    for _ in range(STEPS_TO_BEGIN):
        action.push()
    assert action.observe()[2:] == (stalled, reached)


def test_electric_that_holds_something_is_not_stalled_before_it_was_told_to_move():
    action = _Electric(FakeGripper(position=70.0, force=90.0, gripping=True), SETTINGS, 50.0, 0.0)
    assert action.observe()[2:] == (False, False)


def test_suction_sucks_until_it_holds():
    gripper = FakeGripper()
    action = _Suction(gripper, SETTINGS, 0.0, 70.0)
    gripper.readings["gripping"] = True
    assert not action.observe()[3], "nothing was asked yet"
    action.push()
    action.push()
    assert gripper.sent == ["configure", ("close", 5.0)]
    assert gripper.told == {"vacuum_sensor_threshold": 70.0, "blow_off_seconds": 0.0}
    assert action.observe()[3]


def test_suction_without_a_time_limit():
    gripper = FakeGripper()
    _Suction(gripper, {**SETTINGS, "timeout": -1.0}, 0.0, 0.0).push()
    assert ("close", LONG_SUCTION_S) in gripper.sent


def test_suction_opens_at_100():
    gripper = FakeGripper(blowing=True)
    action = _Suction(gripper, SETTINGS, 100.0, 0.0)
    action.push()
    assert gripper.sent == ["configure", "open"]
    assert not action.observe()[3]
    gripper.readings["blowing"] = False
    assert action.observe()[3]
