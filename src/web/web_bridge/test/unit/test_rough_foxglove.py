# SPDX-License-Identifier: BSD-3-Clause
"""Foxglove clients that misbehave, on a live server: they get an error, and the others notice nothing."""
import json
import struct
import threading

import pytest
from fake_foxglove import FakeFoxgloveGraph, FoxgloveLab
from rough import check_loses_old_messages, check_refuses_foreign_pages, check_visits_leave_nothing, foreign_pages
from std_msgs.msg import Int32, String
from std_srvs.srv import SetBoolRequest

TYPES = {"/tick": "std_msgs/Int32", "/big": "std_msgs/String"}


@pytest.fixture
def lab():
    lab = FoxgloveLab(FakeFoxgloveGraph(TYPES))
    yield lab
    lab.close()


@pytest.fixture
def witness(lab):
    """A client that hears /tick; the others must not disturb it."""
    client = lab.connect()
    client.subscribe("/tick")
    return client


def check(lab, witness):
    lab.graph.send("/tick", Int32(7))
    assert witness.message()[2] == struct.pack("<i", 7)


def test_binary_frames_that_end_too_early(lab, witness):
    client = lab.connect()
    whole = struct.pack("<BIII", 2, 1, 1, 4) + b"ros1"
    for frame in [b"", *(whole[:length] for length in range(1, len(whole))), b"\x01", b"\x01\0\0\0", b"\x00",
                  b"\x09abc", b"\xff" * 100, struct.pack("<BIII", 2, 1, 1, 2 ** 32 - 1) + b"ros1",
                  struct.pack("<BIII", 2, 1, 1, 2) + b"\xff\xfe"]:
        client.socket.send_binary(frame)
        assert "the server failed" not in client.error()
    client.socket.send_binary(whole)
    assert "service 1 does not exist" in client.next("serviceCallFailure")["message"]
    check(lab, witness)


def test_json_of_any_kind(lab, witness):
    client = lab.connect()
    for text in ("[]", "null", "3", '"x"', "{}", "[" * 5000, "{", json.dumps({"op": {"op": {}}}), '{"op": "\\ud800"}'):
        client.socket.send(text)
        assert client.error()
    check(lab, witness)


@pytest.mark.parametrize(("op", "fields"), [
    ("subscribe", ({}, {"subscriptions": 3}, {"subscriptions": [3]}, {"subscriptions": [{}]},
                   {"subscriptions": [{"id": -1, "channelId": 1}]},
                   {"subscriptions": [{"id": 2 ** 32, "channelId": 1}]},
                   {"subscriptions": [{"id": 1, "channelId": 99}]}, {"subscriptions": [{"id": 1, "channelId": "1"}]})),
    ("unsubscribe", ({}, {"subscriptionIds": ["x"]}, {"subscriptionIds": [5]}, {"subscriptionIds": [True]})),
    ("advertise", ({}, {"channels": [[]]}, {"channels": [{"id": 1}]})),
    ("unadvertise", ({"channelIds": [8]}, {"channelIds": {}})),
    ("getParameters", ({}, {"parameterNames": [1]}, {"parameterNames": ["a b"]}, {"parameterNames": [], "id": 5})),
    ("setParameters", ({}, {"parameters": [1]}, {"parameters": [{"name": 5}]})),
    ("subscribeParameterUpdates", ({}, {"parameterNames": [[]]}, {"parameterNames": [""]})),
    ("unsubscribeParameterUpdates", ({}, {"parameterNames": "x"})), ("fetchAsset", ({}, {"requestId": "1"})),
    ("publish", ({},))])
def test_an_operation_that_does_not_fit_is_an_error(lab, witness, op, fields):
    client = lab.connect()
    for one in fields:
        client.send(op, **one)
        assert client.error().startswith((op + ":", "unknown op"))
    check(lab, witness)


def test_a_hundred_thousand_subscriptions(lab, witness):
    client = lab.connect()
    channel = client.channel("/tick")
    client.send("subscribe", subscriptions=[{"id": number, "channelId": channel} for number in range(100_000)])
    assert "subscribed to already, by subscription 0 (and 99998 more of 100000)" in client.error()
    client.send("subscribe", subscriptions=[{"id": number, "channelId": number} for number in range(1000, 101_000)])
    assert "channel 1000 does not exist (and 99999 more of 100000)" in client.error()
    for number in range(300):
        client.send("subscribe", subscriptions=[{"id": number, "channelId": 10 ** 6}])
    client.echo()
    client.send("unsubscribe", subscriptionIds=list(range(100_000)))
    assert "no subscription with id 1 (and 99998 more of 100000)" in client.error()
    check(lab, witness)
    assert len(lab.graph.subscribers["/tick"]) == 1


def test_a_client_publishes_a_limited_number_of_topics(lab, witness):
    client = lab.connect()
    client.send("advertise", channels=[{"id": number, "topic": "/t%d" % number, "encoding": "json",
                                        "schemaName": "std_msgs/Int32"} for number in range(1100)])
    assert "1000 topics, which is the limit (and 99 more of 1100)" in client.error()
    check(lab, witness)


def test_a_reader_that_stops_loses_old_messages_and_delays_nobody():
    lab = FoxgloveLab(FakeFoxgloveGraph(TYPES), buffer_bytes=2_000_000)
    try:
        sleeper, other = lab.connect(), lab.connect()
        sleeper.subscribe("/big", 3)
        other.subscribe("/tick")
        check_loses_old_messages(lab, lambda text: lab.graph.send("/big", String(text)), lambda: check(lab, other),
                                 lambda: int(sleeper.message()[2][4:6]))
        sleeper.echo()
    finally:
        lab.close()


def test_a_client_that_loses_messages_is_told_once():
    lab = FoxgloveLab(FakeFoxgloveGraph(TYPES), buffer_bytes=1000)
    try:
        client = lab.connect()
        client.subscribe("/tick")
        # The loop writes nothing meanwhile.
        hold, held = threading.Event(), threading.Event()
        lab.loop.soon(lambda: (held.set(), hold.wait(60)))
        assert held.wait(60)
        for number in range(1000):
            lab.graph.send("/tick", Int32(number))
        hold.set()
        frames = [client.receive()]
        while frames[-1].get("data", b"")[-4:] != struct.pack("<i", 999):
            frames.append(client.receive())
        assert len(frames) < 100
    finally:
        lab.close()


def test_a_client_that_asks_for_many_files_and_reads_none_does_not_fill_the_memory(tmp_path):
    lab = FoxgloveLab(FakeFoxgloveGraph(TYPES))
    try:
        lab.graph.packages["robot"] = tmp_path
        (tmp_path / "a.stl").write_bytes(bytes(8_000_000))
        client, other = lab.connect(), lab.connect()
        for number in range(30):
            client.send("fetchAsset", uri="package://robot/a.stl", requestId=number)
        other.subscribe("/tick")
        check(lab, other)
        kept = [socket._session.outgoing.kept_bytes for socket in list(lab.clients._open)]
        assert max(kept) <= 32 << 20
        # It was only late: it gets all of them.
        for number in range(30):
            data = client.next(4)["data"]
            assert struct.unpack_from("<IBI", data) == (number, 0, 0) and len(data) == 9 + 8_000_000
    finally:
        lab.close()


def test_clients_that_come_and_go_leave_nothing(lab, witness):
    lab.graph.services["/enable"] = ("std_srvs/SetBool", lambda request: None)

    def visit():
        client = lab.connect()
        client.subscribe("/big")
        client.send("advertise", channels=[{"id": 1, "topic": "/said", "encoding": "json",
                                            "schemaName": "std_msgs/Int32"}])
        client.publish(1, b'{"data": 1}')
        client.send("subscribeConnectionGraph")
        client.send("subscribeParameterUpdates", parameterNames=["/a"])
        client.call(1, 1, SetBoolRequest(True))
        client.socket.sock.close()  # in the middle of it, without a goodbye

    check_visits_leave_nothing(lab, visit, lambda: "/said" not in lab.graph.publishers
                               and list(lab.graph.subscribers) == ["/tick"], lambda: check(lab, witness))
    assert lab.bridge._clients == {socket._session for socket in lab.clients._open}
    assert not lab.bridge._graph_clients and not any(lab.bridge._parameter_clients.values())


def test_a_fault_of_the_graph_costs_one_operation(lab, witness, monkeypatch):
    client = lab.connect()
    channel = client.channel("/big")
    monkeypatch.setattr(lab.graph, "subscribe", lambda topic, arrived: 1 / 0)
    client.send("subscribe", subscriptions=[{"id": 1, "channelId": channel}])
    assert "the server failed at this operation" in client.error()
    client.echo()
    monkeypatch.undo()
    client.subscribe("/big", 1)
    check(lab, witness)


def test_a_fault_while_looking_at_the_graph_is_survived(lab, witness, monkeypatch):
    failed = threading.Event()

    def fail():
        failed.set()
        raise ZeroDivisionError
    monkeypatch.setattr(lab.graph, "state", fail)
    lab.bridge.look_soon()
    assert failed.wait(60)
    monkeypatch.undo()
    lab.graph.publish_topic("/new", "std_msgs/Int32")
    witness.channel("/new")
    check(lab, witness)


def test_nothing_waits_for_a_hung_master(lab, witness, monkeypatch):
    release = threading.Event()
    monkeypatch.setattr(lab.graph, "parameters", lambda: release.wait(60) and {})
    monkeypatch.setattr(lab.graph, "state", lambda: release.wait(60) and lab.graph.__class__.state(lab.graph))
    hanging = [lab.connect() for _ in range(3)]
    for client in hanging:
        client.send("getParameters", parameterNames=[], id="x")
    check(lab, witness)
    witness.echo()
    newcomer = lab.connect()
    newcomer.subscribe("/tick")
    assert not release.is_set()
    release.set()
    for client in hanging:
        assert client.next("parameterValues")["id"] == "x"


@foreign_pages
def test_a_foreign_page_cannot_connect(lab, options):
    check_refuses_foreign_pages(lab, options)
