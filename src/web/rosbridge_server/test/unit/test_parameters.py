# SPDX-License-Identifier: BSD-3-Clause
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rosbridge_server.parameters import read_parameters
from web_bridge.errors import RequestForbidden
from web_bridge.parameters import ParameterError

LAUNCH = Path(__file__).parents[2] / "launch" / "rosbridge_websocket.launch"


def read(**given):
    return read_parameters(lambda name, default: given.get(name, default))


def test_without_parameters_only_this_machine_is_served():
    found = read()
    assert (found.endpoint, found.warnings) == ((9090, "localhost", None, 5.0), ())
    assert found.bridge == (10.0, 600.0) and found.socket.rules.topics == ()
    with pytest.raises(RequestForbidden):
        found.socket.access.check_origin("null", "localhost:9090")


def test_a_port_that_is_open_to_others_without_a_token_is_a_warning():
    for address in ("", "0.0.0.0", "192.168.1.2"):
        assert "everybody on them can move the robot" in read(address=address).warnings[0]
        assert read(address=address, token="t").warnings == ()


def test_tokens_and_pages():
    access = read(token="drive", view_token="look", allowed_origins="https://a.example http://b:80").socket.access
    assert access.may_act("drive") and not access.may_act("look")
    access.check_origin("https://a.example", "localhost:9090")
    # Who has the token may come from a file.
    access.check_origin("null", "localhost:9090")
    read(websocket_null_origin=True).socket.access.check_origin("null", "localhost:9090")


def test_what_the_published_launch_file_passes_is_understood():
    found = read(max_message_size="None", websocket_external_port="None", unregister_timeout=5, topics_glob="['/a/*']",
                 services_glob="[]", use_compression=True, websocket_ping_interval=3)
    assert found.socket.largest_message == 64 << 20 and found.bridge.unregister_timeout == 5.0
    assert found.socket.rules.topics == ("/a/*",) and found.socket.rules.services == ()
    assert found.socket.use_compression and found.socket.ping_interval_s == 3.0


@pytest.mark.parametrize(("given", "text"), [
    ({"port": "x"}, "~port is 'x'"), ({"port": 70000}, "~port is 70000"), ({"port": True}, "~port is True"),
    ({"unregister_timeout": -1}, "~unregister_timeout is -1"), ({"fragment_timeout": "nan"}, "~fragment_timeout"),
    ({"use_compression": "yes"}, "~use_compression is 'yes'; true or false"), ({"authenticate": True}, "set ~token"),
    ({"bson_only_mode": True}, "BSON is not served"), ({"binary_encoder": "bson"}, "BSON is not served"),
    ({"ssl": True}, "~certfile is empty"), ({"view_token": "look"}, "set both"),
    ({"token": "a", "view_token": "a"}, "are the same")])
def test_a_value_that_cannot_be_served_is_named(given, text):
    with pytest.raises(ParameterError) as caught:
        read(**given)
    assert text in str(caught.value)


def test_the_launch_file_passes_every_argument_under_its_name():
    root = ElementTree.parse(LAUNCH).getroot()
    arguments = {tag.get("name") for tag in root.iter("arg")}
    passed = {tag.get("name"): tag.get("value") for tag in root.find("node").iter("param")}
    assert passed == {name: "$(arg %s)" % name for name in arguments}
