# SPDX-License-Identifier: BSD-3-Clause
import pytest

from web_bridge.access import Access, Rules, is_token, patterns_of, without_tokens
from web_bridge.errors import RequestForbidden


@pytest.mark.parametrize(("origin", "host"), [
    (None, "localhost:9090"), ("http://localhost:8000", "localhost:9090"), ("http://127.0.0.1", "localhost:9090"),
    ("http://[::1]:80", "127.0.0.1:9090"), ("http://10.1.2.3:80", "10.1.2.3:9090"), ("https://lab-pc", "lab-pc:9090"),
    ("http://LAB-PC:8080", "lab-pc:9090"), ("https://pages.example:444", "localhost:9090")])
def test_pages_of_this_machine_may_connect(origin, host):
    Access(origins=["https://pages.example:444/"], names=["lab-pc"]).check_origin(origin, host)


@pytest.mark.parametrize(("origin", "host"), [
    ("http://evil.example", "localhost:9090"), ("https://pages.example", "localhost:9090"), ("null", "localhost:9090"),
    # A foreign name that resolves to 127.0.0.1.
    ("http://evil.example", "evil.example:9090"), ("http://localhost.evil.example", "localhost:9090"),
    ("http://10.1.2.3", "10.1.2.4:9090"), ("http://localhost", "10.1.2.4:9090"), ("http://[", "localhost:9090"),
    ("", "localhost:9090"), ("http://localhost:80", None), ("", ""), ("file://", "localhost:9090")])
def test_foreign_pages_may_not(origin, host):
    with pytest.raises(RequestForbidden):
        Access(origins=["https://pages.example:444"], names=["lab-pc"]).check_origin(origin, host)


def test_pages_without_an_origin_and_all_origins_can_be_allowed():
    Access(null_origin=True, names=[]).check_origin("null", "localhost:9090")
    Access(origins=["*"], names=[]).check_origin("http://evil.example", "localhost:9090")


def test_tokens_say_who_may_act():
    access = Access({"drive": True, "look": False}, names=[])
    assert access.may_act("drive") is True and access.may_act("look") is False
    for wrong in ("", "driv", "drive ", "\udcff"):
        with pytest.raises(RequestForbidden, match="token"):
            access.may_act(wrong)
    assert Access(names=[]).may_act("anything") is True


@pytest.mark.parametrize(("text", "patterns"), [
    ("[*]", ()), ("['*']", ()), ("[]", ()), ("", ()), ("['/a/*', '/b']", ("/a/*", "/b")), ('["/a"]', ("/a",)),
    ("/a", ("/a",))])
def test_patterns_are_read_as_rosbridge_writes_them(text, patterns):
    assert patterns_of(text) == patterns


def test_rules_name_what_they_forbid():
    rules = Rules(topics=("/robot/*",), services=("/robot/*",), may_act=False)
    rules.check_topic("/robot/state")
    rules.check_service("/rosapi/topics")
    Rules(services=("/a",)).check_service("/a")
    for check in (lambda: rules.check_topic("/tf"), lambda: rules.check_service("/gazebo/pause_physics"),
                  lambda: rules.check_service("/robot/set"), lambda: rules.check_service("/rosapi/set_param"),
                  lambda: rules.check_service("/rosapi/set_logger_level"),
                  lambda: rules.check_may_act("publish")):
        with pytest.raises(RequestForbidden):
            check()


def test_the_tokens_of_servers_are_not_shown():
    names = ["/a/token", "/a/view_token", "/token", "/a/port", "/a/tokens", "/token/a"]
    assert [is_token(name) for name in names] == [True, True, True, False, False, False]
    # web_video_server may have been started with _token:= alone.
    tree = {"a": {"token": "x", "view_token": "y", "port": 1}, "video": {"token": "z"}, "list": [{"token": 1}]}
    assert without_tokens(tree) == {"a": {"port": 1}, "video": {}, "list": [{"token": 1}]}
