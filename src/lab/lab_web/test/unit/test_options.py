# SPDX-License-Identifier: BSD-3-Clause
"""Options of ./baxter.sh web, and the addresses that it prints."""
import socket
from urllib.parse import parse_qs, urlsplit

import pytest

from lab_web import node


@pytest.mark.parametrize(("words", "text"), [
    (["--port", "99999"], "0 (any free one) to 65535"), (["--port", "-1"], "is no port"),
    (["--port", "http"], "is no port"), (["--token", ""], "is no token"), (["--view-token", "a\nb"], "is no token")])
def test_an_impossible_option_is_refused_with_what_is_possible(capsys, words, text):
    with pytest.raises(SystemExit):
        node.parse(words)
    assert text in capsys.readouterr().err


@pytest.mark.parametrize("token", ["two words", "a&b=c#d", "50%+1", "\u5b9e\u9a8c", "plain-token_1"])
def test_an_address_holds_its_token_whatever_its_signs(monkeypatch, tmp_path, token):
    monkeypatch.setattr(node.rospy, "set_param", lambda *_: None)
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    monkeypatch.setattr(node, "_print_when_started", lambda text: None)
    address = node._announce(8090, (token, "look"), False)
    assert parse_qs(urlsplit(address).query) == {"token": [token]}
    (file,) = node.page_files.folder().iterdir()
    assert file.read_text() == address


def test_in_a_codespace_the_address_is_the_one_that_its_owner_reaches(monkeypatch, tmp_path):
    codespace = {"CODESPACE_NAME": "fuzzy-robot", "GITHUB_CODESPACES_PORT_FORWARDING_DOMAIN": "app.example.dev"}
    assert node.forwarded_address(codespace, 8091) == "https://fuzzy-robot-8091.app.example.dev"
    assert node.forwarded_address({"CODESPACE_NAME": "fuzzy-robot"}, 8091) == ""
    node.Access({"a": True}, [node.forwarded_address(codespace, 8091)], names=[]).check_origin(
        "https://fuzzy-robot-8091.app.example.dev", "localhost:8091")
    for name, value in {**codespace, "ROS_HOME": str(tmp_path)}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(node.rospy, "set_param", lambda *_: None)
    monkeypatch.setattr(node, "_print_when_started", lambda text: None)
    assert node._announce(8091, ("a", "b"), False) == "https://fuzzy-robot-8091.app.example.dev/?token=a"


@pytest.mark.parametrize("port", [None, 8090])
@pytest.mark.parametrize("is_launched", [False, True])
def test_the_operators_address_is_the_last_line_alone(port, is_launched):
    text = node.announcement("http://localhost:8090/?token=a", "http://localhost:8090/?token=b", port, is_launched)
    assert text.splitlines()[-1].strip() == "http://localhost:8090/?token=a" and "token=b" in text
    # Ctrl-C in roslaunch's terminal ends the lab.
    assert ("Ctrl-C" in text) is not is_launched and ("every machine" in text) is (port is not None)


def test_a_taken_port_is_refused_before_the_node_ends_the_page_that_has_it(monkeypatch):
    monkeypatch.setattr(node.rospy, "init_node", lambda *_, **__: pytest.fail("became a node"))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(node.PageFailure, match=str(port)):
            node.serve(node.parse(["--port", str(port)]), None, None)
