# SPDX-License-Identifier: BSD-3-Clause
"""A leader's arm is followed while its cuff is squeezed, from where both are."""
import contextlib
import json
import threading

import numpy as np
import pytest
from tornado import httpserver, ioloop, netutil, web, websocket

from lab_testing.waiting import wait_until
from steering_devices import leader_sources
from steering_devices.leader import Clutch, Leader, topics_of
from steering_devices.leader_sources import LeaderAddressError, follow

CUFF, OK = "/robot/digital_io/left_lower_cuff/state", "/robot/navigators/left_navigator/state"
DT = 0.02


def led(clutch, lead, start, held=lambda _: True):
    """Where a follower gets that does what it is told, for angles of the leader step by step."""
    at, way = np.array(start, dtype=float), []
    for number, angles in enumerate(lead):
        at = at + DT * clutch.velocities(np.array(angles, dtype=float), at, held(number), DT)
        way.append(at.copy())
    return np.array(way)


@pytest.mark.parametrize("signs", [(1.0, 1.0), (-1.0, 1.0)])
def test_the_follower_moves_as_the_leader_does_from_where_it_is(signs):
    lead = np.linspace((0.0, 0.0), (0.5, -0.3), 100)
    way = led(Clutch(np.array(signs)), np.vstack([lead, np.repeat(lead[-1:], 50, axis=0)]), (1.0, 2.0))
    assert way[0] == pytest.approx((1.0, 2.0)), "no jump at the start"
    assert way[-1] == pytest.approx((1.0 + 0.5 * signs[0], 2.0 - 0.3 * signs[1]), abs=1e-3)
    assert np.abs(np.diff(way, axis=0)).max() < 0.012


def test_a_clutch_that_is_let_go_moves_nothing_and_then_begins_again():
    lead = np.concatenate([np.linspace(0.0, 0.4, 50), np.linspace(0.4, -1.0, 50), np.linspace(-1.0, -0.8, 50)])[:, None]
    way = led(Clutch(np.ones(1)), lead, (0.0,), lambda number: not 50 <= number < 100)
    assert way[99] == way[49] and way[-1] == pytest.approx(way[49] + 0.2, abs=0.05)


def test_a_leap_of_the_leader_is_not_followed_until_it_lets_go():
    clutch = Clutch(np.ones(1))
    way = led(clutch, np.concatenate([np.zeros(10), np.full(20, 1.5)])[:, None], (0.0,))
    assert np.abs(way).max() < 1e-9
    assert np.abs(led(clutch, np.full((10, 1), 1.5), (0.0,), lambda number: number > 0)).max() < 1e-9
    assert led(clutch, np.linspace(1.5, 1.6, 20)[:, None], (0.0,))[-1] > 0.05


@pytest.mark.parametrize("name", ["digital_io/torso_upper_button", "digital_io/left_itb_button0",
                                  "navigators/neck_navigator"])
def test_what_is_no_button_of_a_cuff_presses_nothing(name):
    leader = Leader()
    leader.take("/robot/%s/state" % name, {"state": 1, "buttons": [True]}, 10.0)
    assert leader.presses() == []


def test_a_leader_holds_as_long_as_it_is_heard_and_its_cuff_is_squeezed():
    leader = Leader()
    leader.take("/robot/joint_states", {"name": ["left_s0", "left_s1"], "position": [0.5, None]}, 10.0)
    assert leader.position == {"left_s0": 0.5} and not leader.holds("left", 10.0)
    leader.take(CUFF, {"state": 1}, 10.0)
    assert leader.holds("left", 10.1) and not leader.holds("right", 10.1) and not leader.holds("left", 10.2)
    leader.take("/robot/joint_states", {"name": ["left_s0"], "position": [0.6]}, 10.3)
    leader.take(CUFF, {"state": 0}, 10.3)
    assert not leader.holds("left", 10.3)


def test_presses_count_once():
    leader = Leader()
    for down in ([True, False, False], [True, False, False], [False, False, True]):
        leader.take(OK, {"buttons": down}, 1.0)
    leader.take("/robot/digital_io/right_upper_button/state", {"state": 1}, 1.0)
    assert leader.presses() == [("left", "success"), ("left", "again"), ("right", "open")] and not leader.presses()


def test_an_address_of_no_leader_is_refused():
    with pytest.raises(LeaderAddressError, match="ws://"):
        follow("robot:11311", ["left"], pytest.fail, pytest.fail)


class Bridge(websocket.WebSocketHandler):
    """Answers each subscription with one message."""

    def on_message(self, message):
        topic = json.loads(message)["topic"]
        said = {"name": ["left_s0"], "position": [0.1], "state": 1, "buttons": []}
        self.write_message(json.dumps({"op": "publish", "topic": topic, "msg": said}))


class Babbler(Bridge):
    """At first no rosbridge at all, then one that sends something else, then one."""

    answers = []

    def prepare(self):
        self.answers.append(len(self.answers))
        if len(self.answers) == 1:
            raise web.HTTPError(404)

    def on_message(self, message):
        if len(self.answers) == 2:
            self.write_message("[]")
        else:
            super().on_message(message)


@contextlib.contextmanager
def serving(handler):
    """(port, what stops it) of a web server with this handler."""
    ready, sockets, loops = threading.Event(), netutil.bind_sockets(0, "127.0.0.1"), []

    def serve():
        async def begin():
            httpserver.HTTPServer(web.Application([("/", handler)])).add_sockets(sockets)
            loops.append(ioloop.IOLoop.current())
            ready.set()
        loop = ioloop.IOLoop()
        loop.add_callback(begin)
        loop.start()
        loop.close(all_fds=True)

    server = threading.Thread(target=serve)
    server.start()
    assert ready.wait(10.0)

    def stop():
        if server.is_alive():
            loops[0].add_callback(loops[0].stop)
            server.join()
    try:
        yield sockets[0].getsockname()[1], stop
    finally:
        stop()


def test_a_rosbridge_is_heard_and_its_loss_is_told():
    heard, told = {}, []
    with serving(Bridge) as (port, stop):
        end = follow("ws://127.0.0.1:%d/" % port, ["left"], heard.__setitem__, told.append)
        try:
            wait_until(lambda: len(heard) == len(topics_of(["left"])), "a message of each topic", 10.0)
            assert heard[CUFF]["state"] == 1 and not told
            stop()
            wait_until(lambda: told, "its loss to be told", 10.0)
        finally:
            end()


def test_a_leader_that_answers_something_else_is_asked_again(monkeypatch):
    monkeypatch.setattr(leader_sources, "_AGAIN_S", 0.05)
    heard, told = {}, []
    with serving(Babbler) as (port, _):
        end = follow("ws://127.0.0.1:%d/" % port, ["left"], heard.__setitem__, told.append)
        try:
            wait_until(lambda: heard, "a message in the end", 10.0)
        finally:
            end()
    assert len(told) == 2 and "404" in told[0]
