# SPDX-License-Identifier: BSD-3-Clause
"""Clients that misbehave, on a live server: they get an error, and the others notice nothing."""
import json
import os
import threading
import time

import cbor2
import pytest
import websocket
from rough import check_loses_old_messages, check_refuses_foreign_pages, check_visits_leave_nothing, foreign_pages
from std_msgs.msg import Int32, String
from web_lab import WebLab

from lab_testing.waiting import wait_until
from web_bridge.access import Access


@pytest.fixture
def witness(lab):
    """A client that hears /tick; what it is for: the others must not disturb it."""
    client = lab.connect()
    client.send("subscribe", topic="/tick", type="std_msgs/Int32")
    client.echo()
    return client


def check(lab, witness):
    lab.graph.send("/tick", Int32(7))
    assert witness.receive()["msg"] == {"data": 7}


def test_a_message_of_ten_megabytes(lab, witness):
    client, data = lab.connect(), os.urandom(10_000_000)
    client.send("subscribe", topic="/blob", type="std_msgs/UInt8MultiArray", compression="cbor")
    client.send("advertise", topic="/blob", type="std_msgs/UInt8MultiArray")
    client.socket.send_binary(cbor2.dumps({"op": "publish", "topic": "/blob", "msg": {"data": data}}))
    assert client.receive()["msg"]["data"] == data
    check(lab, witness)


def test_half_a_fragment_and_half_an_object(lab, witness):
    client = lab.connect()
    client.send("fragment", id="f", data='{"op": "pub', num=0, total=2)
    client.socket.send('{"op": "publish", "topic"')
    assert "is no JSON object" in client.receive()["msg"]
    client.socket.close()
    check(lab, witness)


@pytest.mark.parametrize("opcode", [websocket.ABNF.OPCODE_TEXT, websocket.ABNF.OPCODE_BINARY])
def test_broken_utf_8(lab, witness, opcode):
    client = lab.connect()
    client.socket.send(b'{"op": "\xff\xfe"}', opcode)
    try:
        assert "UTF-8" in client.receive()["msg"]
    except (websocket.WebSocketException, OSError):
        pass  # RFC 6455: a text frame that is no UTF-8 ends the connection
    check(lab, witness)


def test_a_flood_of_operations(lab, witness):
    client = lab.connect()
    client.send("advertise", topic="/flood", type="std_msgs/Int32")
    for number in range(3000):
        client.send("publish", topic="/flood", msg={"data": number})
    for number in range(300):
        client.send("subscribe", topic="/t%d" % (number % 10), id=str(number), type="std_msgs/Int32")
    check(lab, witness)
    client.echo()
    assert [message.data for name, message in lab.graph.published if name == "/flood"] == list(range(3000))


def test_a_thousand_subscriptions(lab, witness):
    client = lab.connect()
    for number in range(1000):
        client.send("subscribe", topic="/t%d" % number, id=str(number), type="std_msgs/Int32")
    client.echo()
    for number in range(1000):
        lab.graph.send("/t%d" % number, Int32(number))
    assert [client.receive()["msg"]["data"] for _ in range(1000)] == list(range(1000))
    client.socket.close()
    wait_until(lambda: list(lab.graph.subscribers) == ["/tick"], "the end of the subscriptions")
    check(lab, witness)


def test_a_reader_that_stops_loses_old_messages_and_delays_nobody():
    lab = WebLab(buffer_bytes=2_000_000)
    try:
        sleeper, other = lab.connect(), lab.connect()
        sleeper.send("subscribe", topic="/big", type="std_msgs/String")
        sleeper.echo()
        other.send("subscribe", topic="/tick", type="std_msgs/Int32")
        other.echo()
        check_loses_old_messages(lab, lambda text: lab.graph.send("/big", String(text)), lambda: check(lab, other),
                                 lambda: int(sleeper.receive()["msg"]["data"].partition(":")[0]))
        sleeper.echo()
    finally:
        lab.close()


def test_clients_that_come_and_go_leave_nothing(lab, witness):
    def visit():
        client = lab.connect()
        client.send("subscribe", topic="/tick", type="std_msgs/Int32")
        client.send("advertise", topic="/said", type="std_msgs/Int32")
        client.send("publish", topic="/said", msg={"data": 1})
        client.send("advertise_service", service="/s%d" % id(client), type="std_srvs/SetBool")
        client.send("call_service", service="/nowhere")
        client.socket.sock.close()  # in the middle of it, without a goodbye

    check_visits_leave_nothing(lab, visit, lambda: not lab.graph.offered and "/said" not in lab.graph.publishers,
                               lambda: check(lab, witness))
    assert len(lab.graph.subscribers["/tick"]) == 1


def test_a_simulator_that_comes_back_with_another_type(lab, witness):
    client = lab.connect()
    client.send("subscribe", topic="/x")
    client.echo()
    lab.graph.send("/x", Int32(1))
    lab.graph.send("/x", String("now a text"))
    assert [client.receive()["msg"]["data"] for _ in range(2)] == [1, "now a text"]


def test_a_fault_of_the_graph_costs_one_operation(lab, witness, monkeypatch):
    client = lab.connect()
    client.send("advertise", topic="/said", type="std_msgs/Int32")
    monkeypatch.setattr(lab.graph, "subscribe", lambda topic, arrived: 1 / 0)
    client.send("subscribe", topic="/y", type="std_msgs/Int32")
    assert "the server failed at this operation" in client.receive()["msg"]
    client.echo()
    client.socket.close()
    wait_until(lambda: "/said" not in lab.graph.publishers, "the end of what the client advertised")
    check(lab, witness)


@foreign_pages
def test_a_foreign_page_cannot_connect(lab, options):
    check_refuses_foreign_pages(lab, options)


def test_nobody_connects_without_a_token():
    lab = WebLab(access=Access({"drive": True, "look": False}, names=[]))
    try:
        for query in ("", "?token=", "?token=driv", "?token=%ff"):
            with pytest.raises(websocket.WebSocketBadStatusException, match="403"):
                lab.connect(query)
        lab.connect("?token=drive").echo()
        lab.connect("rosbridge", header=["Authorization: Bearer drive"]).echo()
        viewer = lab.connect("?token=look")
        viewer.send("publish", topic="/a", msg={})
        assert "the view token does not allow to publish" in viewer.receive()["msg"]
        viewer.send("call_service", service="/gazebo/pause_physics", id=1)
        assert viewer.receive()["result"] is False
        viewer.send("subscribe", topic="/tick", type="std_msgs/Int32")
        viewer.echo()
        lab.graph.send("/tick", Int32(3))
        assert viewer.receive()["msg"] == {"data": 3}
    finally:
        lab.close()


def test_a_frame_beyond_the_limit_ends_its_connection():
    lab = WebLab(largest_message=1000)
    try:
        client, other = lab.connect(), lab.connect()
        client.send("x" * 2000)
        with pytest.raises((websocket.WebSocketException, OSError)):
            while True:
                client.receive()
        other.echo()
    finally:
        lab.close()


def test_nothing_waits_for_a_hung_master(lab, witness, monkeypatch):
    release = threading.Event()
    monkeypatch.setattr(lab.graph, "check_type", lambda topic, kind: release.wait(60))
    hanging = [lab.connect() for _ in range(3)]
    for number, client in enumerate(hanging):
        client.send("advertise", topic="/h%d" % number, type="std_msgs/Int32")
    begin = time.monotonic()
    check(lab, witness)
    witness.echo()
    assert not release.is_set() and time.monotonic() - begin < 60
    release.set()
    for client in hanging:
        client.echo()


def test_a_master_that_hangs_at_the_end_of_a_publisher_delays_nobody(lab, witness, monkeypatch):
    waits, release = threading.Event(), threading.Event()
    client = lab.connect()
    client.send("advertise", topic="/said", type="std_msgs/Int32")
    client.echo()
    monkeypatch.setattr(lab.graph.publishers["/said"], "close", lambda: waits.set() or release.wait(600))
    try:
        client.send("unadvertise", topic="/said")
        assert waits.wait(60)
        witness.send("publish", topic="/said", msg={"data": 1})
        check(lab, witness)
        lab.connect().echo()
    finally:
        release.set()
    witness.echo()


def test_it_goes_on_after_json_of_any_kind(lab, witness):
    client = lab.connect()
    for text in ("[]", "null", "3", '"x"', "{}", "[" * 5000, json.dumps({"op": {"op": {}}}),
                 '{"op": "publish", "topic": "\\ud800"}'):
        client.socket.send(text)
        assert client.receive()["op"] == "status"
    check(lab, witness)
