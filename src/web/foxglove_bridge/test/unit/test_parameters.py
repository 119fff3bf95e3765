# SPDX-License-Identifier: BSD-3-Clause
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from foxglove_bridge.parameters import read_parameters
from web_bridge.errors import RequestForbidden
from web_bridge.foxglove.rules import CAPABILITIES
from web_bridge.parameters import ParameterError

LAUNCH = Path(__file__).parents[2] / "launch" / "foxglove_bridge.launch"


def read(**given):
    return read_parameters(lambda name, default: given.get(name, default))


def test_without_parameters_only_this_machine_is_served():
    found = read()
    assert (found.endpoint[:3], found.warnings) == ((8765, "localhost", None), ())
    assert (found.longest_look_s, found.probe_s, found.socket.buffer_bytes) == (5.0, 0.25, 10_000_000)
    assert found.socket.rules.capabilities == CAPABILITIES
    with pytest.raises(RequestForbidden):
        found.socket.access.check_origin("https://app.foxglove.dev", "localhost:8765")


def test_a_port_that_is_open_to_others_without_a_token_is_a_warning():
    assert "everybody on them can move the robot" in read(address="0.0.0.0").warnings[0]
    assert read(address="0.0.0.0", token="t").warnings == ()


def test_lists_are_regular_expressions_for_whole_names():
    found = read(topic_whitelist=["/robot/.*", "/tf"], service_whitelist=[], client_topic_whitelist=["/cmd"])
    rules = found.socket.rules
    assert [rules.shows_topic(name) for name in ("/robot/state", "/tf", "/tf_static")] == [True, True, False]
    assert not rules.shows_service("/a")
    rules.check_publish("/cmd")
    with pytest.raises(RequestForbidden):
        rules.check_publish("/cmd_vel")


def test_numbers_and_capabilities():
    found = read(max_update_ms=1000, send_buffer_limit=5, service_type_retrieval_timeout_ms=500,
                 capabilities=["time", "parameters"], allowed_origins="https://app.foxglove.dev")
    assert (found.longest_look_s, found.probe_s, found.socket.buffer_bytes) == (1.0, 0.5, 5)
    assert found.socket.rules.capabilities == ("parameters",)
    found.socket.access.check_origin("https://app.foxglove.dev", "localhost:8765")


@pytest.mark.parametrize(("given", "text"), [
    ({"port": "x"}, "~port is 'x'"), ({"tls": True}, "~tls is true and ~certfile is empty"),
    ({"topic_whitelist": ["("]}, "~topic_whitelist: '(' is no regular expression"),
    ({"topic_whitelist": "/a"}, "a list of texts"), ({"param_whitelist": [1]}, "~param_whitelist is [1]"),
    ({"capabilities": ["fly"]}, "~capabilities has fly; known are clientPublish"), ({"view_token": "a"}, "set both"),
    ({"send_buffer_limit": -1}, "~send_buffer_limit is -1")])
def test_a_value_that_cannot_be_served_is_named(given, text):
    with pytest.raises(ParameterError) as caught:
        read(**given)
    assert text in str(caught.value)


def test_the_launch_file_passes_every_argument_under_its_name():
    root = ElementTree.parse(LAUNCH).getroot()
    defaults = {tag.get("name"): tag.get("default") for tag in root.iter("arg")}
    node = root.find("node")
    passed = {tag.get("name"): tag.get("value") for tag in node.iter("param")}
    passed.update({tag.get("param"): tag.text for tag in node.iter("rosparam")})
    assert passed == {name: "$(arg %s)" % name for name in defaults}
    lists = {tag.get("param"): yaml.safe_load(defaults[tag.get("param")]) for tag in node.iter("rosparam")}
    given = {name: yaml.safe_load(value) for name, value in defaults.items() if value}
    assert read(**{**given, **lists}).socket.rules == read().socket.rules
