# SPDX-License-Identifier: BSD-3-Clause
"""The headers that are passed on to another server and back, and those that are not."""
import pytest
from tornado.httputil import HTTPHeaders

from web_bridge import http_text


def headers(**values):
    return HTTPHeaders({name.replace("_", "-"): value for name, value in values.items()})


def test_a_request_loses_the_own_cookie_and_what_belongs_to_its_connection():
    text = http_text.request_head("POST", "/screen?token=x", headers(
        Host="lab.example:8100", Origin="http://lab.example:8100", Cookie="a=1; lab_token=secret; b=2",
        Connection="keep-alive", Transfer_Encoding="chunked", Content_Type="text/csv"), 4,
        own_cookie="lab_token").decode()
    assert text.startswith("POST /screen?token=x HTTP/1.0\r\nHost: localhost\r\n") and text.endswith("\r\n\r\n")
    assert "Cookie: a=1; b=2\r\n" in text and "Content-Type: text/csv" in text and "Content-Length: 4" in text
    assert "secret" not in text and "example" not in text and "chunked" not in text and "keep-alive" not in text


def test_an_upgrade_says_so():
    given = headers(Upgrade="websocket", Sec_Websocket_Key="k")
    text = http_text.request_head("GET", "/lab", given, 0, True).decode()
    assert "HTTP/1.1\r\n" in text and "Upgrade: websocket" in text and "Sec-Websocket-Key: k" in text


def test_an_answer_cannot_reach_beyond_its_lab():
    status, given = http_text.answer_head(
        b"HTTP/1.0 302 Found\r\nLocation: /next\r\nService-Worker-Allowed: /\r\nClear-Site-Data: \"*\"\r\n"
        b"Set-Cookie: x=1; Path=/; Domain=example.org\r\nSet-Cookie: lab_token=mine; Path=/\r\n"
        b"Set-Cookie: y=2; Path=/ben/\r\nContent-Type: text/html\r\n\r\n")
    passed = http_text.passed_on(given, "/anna", own_cookie="lab_token")
    assert status == 302
    assert {name for name, _ in passed} == {"Location", "Content-Type", "Set-Cookie"}
    assert ("Location", "/anna/next") in passed
    cookies = [value for name, value in passed if name == "Set-Cookie"]
    assert cookies == ["x=1; Path=/anna/", "y=2; Path=/anna/"]


@pytest.mark.parametrize("head", [b"SSH-2.0\r\n\r\n", b"HTTP/1.1 xx Bad\r\n\r\n", b"\r\n\r\n",
                                  b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n",
                                  b"HTTP/1.1 200 OK\r\nno colon\r\n\r\n"])
def test_an_answer_that_is_none_is_refused(head):
    with pytest.raises(http_text.BadAnswer):
        http_text.answer_head(head)


BEAT = b"\x81\x84mask" + b"beat"
PONG = b"\x8a\x80mask"


def test_a_server_that_knows_its_longer_path_is_seen_at_the_shorter_one():
    _, given = http_text.answer_head(
        b"HTTP/1.0 302 Found\r\nLocation: /anna/notebook/lab?x=1\r\nSet-Cookie: x=1; Path=/anna/notebook/\r\n\r\n")
    assert http_text.passed_on(given, "", "/anna") == [("Location", "/notebook/lab?x=1"),
                                                       ("Set-Cookie", "x=1; Path=/anna/notebook/")]


def test_heartbeats_are_recognized():
    assert http_text.is_heartbeat(BEAT) and http_text.is_heartbeat(BEAT + PONG + BEAT)
    assert not http_text.is_heartbeat(BEAT + b"\x81\x8amask" + b"{\"op\":\"x\"}")
    assert not http_text.is_heartbeat(BEAT[:-1])
    assert not http_text.is_heartbeat(b"\x82\x84mask1234")
