# SPDX-License-Identifier: BSD-3-Clause
"""A class behind another server, with TLS and a path in front of all addresses."""
import argparse
import asyncio
from pathlib import Path

import pytest
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets

from lab_class import command, front_door, launching
from lab_class.labs import ClassError, ClassLabState, Labs
from lab_class.store import ClassOptions, ClassRecord, Store, Tokens
from rf_checks.roster import Student
from world_picture.results import READY

PAGE = Path(__file__).resolve().parents[2] / "page"
ADDRESS = "https://labs.example/a.b/robots"
PREFIX = "/a.b/robots"


class Supervisor:
    def __init__(self):
        self.labs = Labs(["anna"], 1, None)

    def request(self, name):
        return self.labs[name]


def test_printed_addresses_begin_with_the_servers(tmp_path):
    record = ClassRecord.made(ClassOptions(address=ADDRESS), [Student("anna", "Anna")])
    address = command._address(record, Store(tmp_path), "anna")
    assert address == "%s/anna/?token=%s" % (ADDRESS, record.tokens["anna"].act)
    assert ClassOptions(address=ADDRESS).prefix == PREFIX and ClassOptions(address="https://labs.example").prefix == ""


@pytest.mark.parametrize("text", ["labs.example", "ftp://labs.example", "https:///x", "https://a/b?c", "https://a/(.*)"])
def test_an_address_that_is_none(text):
    with pytest.raises(argparse.ArgumentTypeError, match="expected an address such as https://labs.example"):
        command._server(text)
    assert command._server("https://labs.example/robots/") == "https://labs.example/robots"


def test_all_paths_of_the_door_begin_with_the_servers():
    async def check():
        record = ClassRecord.made(ClassOptions(address=ADDRESS), [Student("anna", "Anna")])
        supervisor = Supervisor()
        supervisor.labs["anna"].state = ClassLabState.STOPPED
        server = HTTPServer(front_door.application(front_door.FrontDoor(record, supervisor), PAGE))
        sockets = bind_sockets(0, "127.0.0.1")
        server.add_sockets(sockets)

        async def ask(path):
            reader, writer = await asyncio.open_connection(*sockets[0].getsockname())
            writer.write(("GET %s HTTP/1.1\r\nHost: labs.example\r\nConnection: close\r\n\r\n" % path).encode())
            answer = (await reader.read()).decode()
            writer.close()
            return int(answer.split()[1]), answer

        token = "?token=" + record.tokens["anna"].act
        status, answer = await ask(PREFIX + "/anna/" + token)
        assert status == 503 and "Path=%s/anna/;" % PREFIX in answer and "; Secure" in answer
        status, answer = await ask(PREFIX + "/anna" + token)
        assert status == 302 and "Location: %s/anna/?token=" % PREFIX in answer
        for path in ("/anna/" + token, "/aXb/robots/anna/" + token, "/instructor/"):
            assert (await ask(path))[0] == 404, path
        assert (await ask(PREFIX + "/instructor/"))[0] == 200
        status, answer = await ask(PREFIX + "/")
        assert status == 404 and ADDRESS + "/NAME/?token=" in answer
        server.stop()
        await server.close_all_connections()

    async def limited():
        async with asyncio.timeout(20.0):
            await check()

    asyncio.run(limited())


def test_a_lab_knows_the_whole_path(tmp_path):
    place = launching.LabPlace(tmp_path / "anna", tmp_path, tmp_path / "libraries", False)
    found, _, _ = launching.prepared(place, ClassOptions(address=ADDRESS), Tokens("a", "b"), 3, ([], ()))
    assert found[found.index("--below") + 1] == PREFIX + "/anna"


def test_a_lab_sees_what_set_up_has_made_ready_for_pictures(tmp_path, monkeypatch):
    place = launching.LabPlace(tmp_path / "anna", tmp_path, tmp_path / "libraries", True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert READY not in launching.prepared(place, ClassOptions(), Tokens("a", "b"), 3, ([], ()))[1]
    ready = tmp_path / "cache" / "bullet_gazebo"
    ready.mkdir(parents=True)
    (place.folder / "caches").rename(tmp_path / "former caches")
    found, environment, _ = launching.prepared(place, ClassOptions(), Tokens("a", "b"), 3, ([], ()))
    assert found[found.index(str(ready)) - 1:][:3] == ["--ro-bind", str(ready), environment[READY]]
    place = launching.LabPlace(tmp_path / "bo", tmp_path, tmp_path / "libraries", False)
    assert launching.prepared(place, ClassOptions(), Tokens("a", "b"), 3, ([], ()))[1][READY] == str(ready)


def test_a_launch_file_that_no_lab_sees_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(command.isolation, "workspaces", lambda environment: ["/srv/space"])
    for words in (("baxter_gazebo", "baxter_world.launch"), ("/srv/space/src/my.launch",), ("/opt/my.launch",)):
        command._refuse_launch_outside(ClassOptions(launch=words))
    command._refuse_launch_outside(ClassOptions(launch=("/home/me/my.launch",), trusted=True))
    with pytest.raises(ClassError, match="labs do not see /home/me/my.launch; put .* /srv/space"):
        command._refuse_launch_outside(ClassOptions(launch=("/home/me/my.launch",)))
