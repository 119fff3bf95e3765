# SPDX-License-Identifier: BSD-3-Clause
"""Settings over lists instead of topics, read back with dynamic_reconfigure's own decoder."""
import pytest
import rospy
from dynamic_reconfigure.encoding import decode_config, decode_description, encode_config
from dynamic_reconfigure.srv import ReconfigureRequest

from loop_ros.reconfigure import Setting, SettingsServer
from loop_ros.testing import FakeRos

SETTINGS = [Setting("p", 10.0, 0.0, 100.0, "gain"), Setting("steps", 3, 1, 9, "how many"),
            Setting("on", False, meaning="whether")]


@pytest.fixture
def server():
    ros, applied = FakeRos(), []

    def take(values):
        if values["steps"] == 7:
            raise ValueError("7 steps are unlucky; take 6 or 8")
        applied.append(values)

    server = SettingsServer(ros, "arm/pid", SETTINGS, take)
    server.ros, server.applied = ros, applied
    server.set = lambda **values: decode_config(
        ros.services["arm/pid/set_parameters"](ReconfigureRequest(encode_config(values))).config)
    server.told = lambda: decode_config(ros.publishers["arm/pid/parameter_updates"].messages[-1])
    return server


def of(config):
    return {name: config[name] for name in ("p", "steps", "on")}


def test_descriptions_are_what_clients_read(server):
    description = decode_description(server.ros.publishers["arm/pid/parameter_descriptions"].messages[0])
    columns = ("name", "type", "min", "max", "default")
    assert [tuple(row[column] for column in columns) for row in description["parameters"]] == [
        ("p", "double", 0.0, 100.0, 10.0), ("steps", "int", 1, 9, 3), ("on", "bool", False, True, False)]
    assert of(server.told()) == {"p": 10.0, "steps": 3, "on": False}


def test_a_change_is_applied_answered_and_told(server):
    assert of(server.set(p=20.5, on=True)) == {"p": 20.5, "steps": 3, "on": True}
    assert server.applied == [{"p": 20.5, "steps": 3, "on": True}]
    assert of(server.told()) == {"p": 20.5, "steps": 3, "on": True}


def test_numbers_end_at_their_range(server):
    assert of(server.set(p=1e9, steps=-4)) == {"p": 100.0, "steps": 1, "on": False}


@pytest.mark.parametrize(("values", "text"), [
    ({"q": 1.0}, "arm/pid: there is no setting 'q'; settings: p, steps, on"), ({"p": float("nan")}, "p is nan"),
    ({"p": "high"}, "p is a double, not a str"), ({"p": 4}, "p is a double, not a int"),
    ({"p": 1.0, "steps": 7}, "7 steps are unlucky")])
def test_what_is_wrong_changes_nothing(server, values, text):
    with pytest.raises(rospy.ServiceException, match=text):
        server.set(**values)
    assert server.applied == [] and of(server.told()) == {"p": 10.0, "steps": 3, "on": False}


def test_changes_from_elsewhere_are_told_once(server):
    server.show(p=11.0)
    server.show(p=11.0)
    assert of(server.told())["p"] == 11.0 and len(server.ros.publishers["arm/pid/parameter_updates"].messages) == 2
    assert server.applied == []
