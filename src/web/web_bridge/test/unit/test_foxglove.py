# SPDX-License-Identifier: BSD-3-Clause
"""The Foxglove WebSocket protocol on a live server in front of a fake graph."""
import base64
import struct

import pytest
import websocket
from fake_foxglove import FakeFoxgloveGraph, FoxgloveLab
from fake_graph import serialized
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Int32, String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from lab_testing.waiting import wait_until
from web_bridge.access import Access
from web_bridge.errors import BridgeError
from web_bridge.feeds import Arrival
from web_bridge.foxglove.rules import FoxgloveRules, compiled

TYPES = {"/tick": "std_msgs/Int32", "/pose": "geometry_msgs/PoseStamped"}


@pytest.fixture
def lab():
    lab = FoxgloveLab(FakeFoxgloveGraph(TYPES))
    yield lab
    lab.close()


def made(**options):
    return FoxgloveLab(FakeFoxgloveGraph(TYPES), **options)


@pytest.mark.parametrize(("offered", "chosen"), [
    (["foxglove.websocket.v1"], "foxglove.websocket.v1"), (["foxglove.sdk.v1"], "foxglove.sdk.v1"),
    (["other", "foxglove.sdk.v1", "foxglove.websocket.v1"], "foxglove.sdk.v1")])
def test_the_clients_first_subprotocol_is_chosen(lab, offered, chosen):
    assert lab.connect(subprotocols=offered).socket.subprotocol == chosen


@pytest.mark.parametrize("offered", [[], ["rosbridge"]])
def test_a_client_of_another_protocol_is_refused_with_the_reason(lab, offered):
    with pytest.raises(websocket.WebSocketBadStatusException, match=r"400.*foxglove\.websocket\.v1"):
        lab.connect(subprotocols=offered)


def test_the_server_says_first_what_it_can_do(lab):
    info = lab.connect().receive()
    assert info == {
        "op": "serverInfo", "name": "/bridge", "sessionId": "s1", "metadata": {"ROS_DISTRO": "one"},
        "supportedEncodings": ["ros1", "json"], "capabilities": [
            "clientPublish", "parameters", "parametersSubscribe", "services", "connectionGraph", "assets"]}


def test_a_channel_has_the_whole_definition(lab):
    client = lab.connect()
    client.channel("/pose")
    channel = client.channels["/pose"]
    assert (channel["encoding"], channel["schemaEncoding"], channel["schemaName"]) \
        == ("ros1", "ros1msg", "geometry_msgs/PoseStamped")
    assert "=" * 80 + "\nMSG: geometry_msgs/Quaternion\n" in channel["schema"]


def test_messages_are_forwarded_as_they_came(lab):
    clients = [lab.connect() for _ in range(3)]
    for number, client in enumerate(clients):
        client.subscribe("/pose", 5 + number)
    message = PoseStamped()
    message.pose.position.x = 1.5
    lab.graph.send("/pose", message)
    for number, client in enumerate(clients):
        assert client.message() == (5 + number, 5_000_000_006, serialized(message))
    assert len(lab.graph.subscribers["/pose"]) == 1


def test_the_last_client_takes_the_subscription_along(lab):
    first, second = lab.connect(), lab.connect()
    first.subscribe("/tick")
    second.subscribe("/tick", 7)
    first.send("unsubscribe", subscriptionIds=[0])
    first.echo()
    lab.graph.send("/tick", Int32(1))
    assert second.message()[2] == struct.pack("<i", 1)
    second.send("unsubscribe", subscriptionIds=[7])
    second.echo()
    assert not lab.graph.subscribers and not lab.bridge.feeds.channel_ids
    first.subscribe("/tick")
    lab.graph.send("/tick", Int32(2))
    assert first.message()[2] == struct.pack("<i", 2)


def test_a_latched_message_reaches_each_client_while_its_publisher_lives(lab):
    first, second, third = (lab.connect() for _ in range(3))
    first.subscribe("/tick")
    lab.graph.alive = {"/robot"}
    lab.graph.send("/tick", Int32(3), is_latched=True)
    assert first.message()[2] == struct.pack("<i", 3)
    second.send("subscribe", subscriptions=[{"id": 9, "channelId": second.channel("/tick")}])
    assert second.message()[::2] == (9, struct.pack("<i", 3))
    lab.graph.alive = set()
    third.send("subscribe", subscriptions=[{"id": 0, "channelId": third.channel("/tick")}])
    third.send("are you there")
    assert third.until(lambda frame: frame["op"] in (1, "status"))["op"] == "status"
    lab.graph.send("/tick", Int32(4))
    assert third.message()[2] == struct.pack("<i", 4)


def test_channels_come_and_go(lab):
    client = lab.connect()
    old = client.channel("/tick")
    lab.graph.publish_topic("/new", "std_msgs/String")
    new = client.channel("/new")
    client.subscribe("/tick", 1)
    lab.graph.end_topic("/tick")
    assert client.next("unadvertise")["channelIds"] == [old]
    wait_until(lambda: lab.bridge.feeds.channel_ids == [], "the end of the subscription")
    lab.graph.publish_topic("/tick", "std_msgs/String")
    # The same id: the client knows that its old subscription has gone with the channel.
    client.subscribe("/tick", 1)
    assert client.channels["/tick"]["id"] not in (old, new)
    lab.graph.send("/tick", String("now a text"))
    assert client.message()[2].endswith(b"now a text")


def test_a_message_of_another_type_or_definition_is_not_sent(lab):
    client = lab.connect()
    client.subscribe("/tick")
    lab.graph.send("/tick", String("x"))
    for _ in range(3):
        lab.graph.subscribers["/tick"][0](Arrival(bytes(4), "std_msgs/Int32", "0" * 32, (5, 6)))
    assert "another definition of std_msgs/Int32" in client.error()
    lab.graph.send("/tick", Int32(2))
    assert client.message()[2] == struct.pack("<i", 2)


def test_a_topic_whose_type_nobody_knows_is_left_out(lab):
    lab.graph.publish_topic("/strange", "nobody_msgs/Thing")
    lab.graph.publish_topic("/zebra", "std_msgs/Int32")
    client = lab.connect()
    client.channel("/zebra")
    assert set(client.channels) == {"/tick", "/pose", "/zebra"}


def test_topics_beyond_the_whitelist_are_not_there():
    lab = made(rules=FoxgloveRules(topics=compiled(["/po.*", "/t"])))
    try:
        client = lab.connect()
        client.channel("/pose")
        assert list(client.channels) == ["/pose"]
    finally:
        lab.close()


@pytest.mark.parametrize(("encoding", "data"), [("ros1", serialized(String("hello"))), ("json", b'{"data": "hello"}')])
def test_a_client_publishes(lab, encoding, data):
    client, other = lab.connect(), lab.connect()
    client.send("advertise", channels=[{"id": 4, "topic": "/said", "encoding": encoding,
                                        "schemaName": "std_msgs/String"}])
    # Also other clients see the topic.
    other.subscribe("/said")
    client.publish(4, data)
    assert other.message()[2] == serialized(String("hello"))
    assert lab.graph.published == [("/said", String("hello"))]
    client.send("unadvertise", channelIds=[4])
    wait_until(lambda: "/said" not in lab.graph.publishers, "the end of the publisher")
    client.publish(4, data)
    assert "does not advertise a channel 4" in client.error()


def test_what_cannot_be_published_is_said(lab):
    client = lab.connect()

    def advertise(**fields):
        client.send("advertise", channels=[{
            "id": 1, "topic": "/said", "encoding": "ros1", "schemaName": "std_msgs/Int32", **fields}])
    for fields, reason in (
            ({"encoding": "cdr"}, "encoding is 'cdr'; ros1 and json"), ({"topic": "a b"}, "no legal name"),
            ({"schemaName": "no/Type"}, "no/Type"), ({"id": -1}, "id is -1"), ({"id": True}, "id is True"),
            ({"topic": "/pose"}, "has the type geometry_msgs/PoseStamped"), ({"topic": None}, "missing")):
        advertise(**fields)
        assert reason in client.error()
    advertise()
    advertise()
    assert "channel 1 is advertised already" in client.error()
    advertise(id=2, encoding="json")
    for number, data, reason in (
            (1, b"abc", "/said: 3 bytes are no std_msgs/Int32"), (1, bytes(5), "it ends after 4"),
            (2, b"[]", "no JSON"),
            (2, b'{"data": "x"}', "data"), (2, b"\xff", "no JSON"), (3, b"", "a channel 3")):
        client.publish(number, data)
        assert reason in client.error()
    assert not lab.graph.published


def test_a_client_that_goes_takes_its_publications_along(lab):
    client = lab.connect()
    client.send("advertise", channels=[{"id": 1, "topic": "/said", "encoding": "json", "schemaName": "std_msgs/Int32"}])
    client.echo()
    assert "/said" in lab.graph.publishers
    client.socket.close()
    wait_until(lambda: "/said" not in lab.graph.publishers, "the end of the publisher")


def test_services(lab):
    def enable(request):
        if not request.data:
            raise RuntimeError("out of order")
        return SetBoolResponse(True, "enabled")
    lab.graph.services["/enable"] = ("std_srvs/SetBool", enable)
    client = lab.connect()
    number = client.service("/enable")
    service = client.services["/enable"]
    assert (service["type"], service["request"]["schemaName"]) == ("std_srvs/SetBool", "std_srvs/SetBoolRequest")
    assert "bool data" in service["request"]["schema"] and "string message" in service["responseSchema"]
    client.call(number, 77, SetBoolRequest(True))
    answer = client.next(3)["data"]
    assert struct.unpack_from("<III", answer) == (number, 77, 4) and answer[12:16] == b"ros1"
    assert SetBool._response_class().deserialize(answer[16:]) == SetBoolResponse(True, "enabled")
    for given, reason in (((number, 78, SetBoolRequest(False)), "out of order"), ((99, 79, b""), "99 does not exist"),
                          ((number, 80, b"ab"), "2 bytes are no std_srvs/SetBoolRequest"),
                          ((number, 81, b"{}", b"json"), "called in ros1")):
        client.call(*given)
        failure = client.next("serviceCallFailure")
        assert reason in failure["message"] and (failure["serviceId"], failure["callId"]) == given[:2]
    # A program that was restarted offers another type.
    lab.graph.services["/enable"] = ("std_srvs/Trigger", enable)
    client.call(number, 82, SetBoolRequest(True))
    assert "no longer a std_srvs/SetBool" in client.next("serviceCallFailure")["message"]
    assert client.next("unadvertiseServices")["serviceIds"] == [number]
    client.services.clear()
    assert client.service("/enable") != number and client.services["/enable"]["type"] == "std_srvs/Trigger"


def test_parameters(lab):
    robot = {"name": "baxter", "gain": 2.0, "n": 3, "on": True, "list": [1.0, 2.5], "odd": float("nan")}
    lab.graph.tree = {"robot": robot, "run_id": "x"}
    client, other = lab.connect(), lab.connect()

    def asked(*names):
        client.send("getParameters", parameterNames=names, id="q")
        answer = client.next("parameterValues")
        assert answer["id"] == "q"
        return {one["name"]: (one["value"], one.get("type")) for one in answer["parameters"]}
    assert asked() == {"/robot/name": ("baxter", None), "/robot/gain": (2.0, "float64"), "/robot/n": (3, None),
                       "/robot/on": (True, None), "/robot/list": ([1.0, 2.5], "float64_array"), "/run_id": ("x", None)}
    assert asked("/run_id", "robot/n", "/nowhere", "/robot/n/x", "/") == {"/run_id": ("x", None), "/robot/n": (3, None)}
    other.send("subscribeParameterUpdates", parameterNames=["/robot/gain", "/blob", "/robot/n"])
    other.echo()
    client.send("setParameters", id="s", parameters=[
        {"name": "/robot/gain", "value": 5, "type": "float64"}, {"name": "/robot/n", "value": None},
        {"name": "/blob", "value": base64.b64encode(b"\0\1").decode(), "type": "byte_array"},
        {"name": "/big", "value": 2 ** 40}])
    assert "/big" not in lab.graph.tree and "does not fit into 32 bits" in client.error()
    assert [one["name"] for one in client.next("parameterValues")["parameters"]] == ["/robot/gain", "/blob"]
    told = [other.next("parameterValues")["parameters"][0] for _ in range(3)]
    assert told == [{"name": "/robot/gain", "value": 5.0, "type": "float64"}, {"name": "/robot/n"},
                    {"name": "/blob", "value": "AAE=", "type": "byte_array"}]
    assert isinstance(lab.graph.tree["robot"]["gain"], float) and "n" not in lab.graph.tree["robot"]
    assert lab.graph.tree["blob"].data == b"\0\1"
    # Another node changes one.
    lab.graph.change_parameter("/robot/gain", 7.5)
    assert other.next("parameterValues")["parameters"][0]["value"] == 7.5
    other.send("unsubscribeParameterUpdates", parameterNames=["/robot/gain"])
    other.echo()
    lab.graph.change_parameter("/robot/gain", 8.5)
    lab.graph.change_parameter("/robot/n", 9)
    assert other.next("parameterValues")["parameters"][0]["value"] == 9


def test_a_parameter_that_could_not_be_watched_is_tried_again(lab, monkeypatch):
    client = lab.connect()

    def fail(_name):
        raise BridgeError("the master does not answer")
    with monkeypatch.context() as broken:
        broken.setattr(lab.graph, "watch_parameter", fail)
        client.send("subscribeParameterUpdates", parameterNames=["/a"])
        assert "the master does not answer" in client.error()
    client.send("subscribeParameterUpdates", parameterNames=["/a"])
    client.echo()
    lab.graph.change_parameter("/a", 3)
    assert client.next("parameterValues")["parameters"] == [{"name": "/a", "value": 3}]


@pytest.mark.parametrize(("parameter", "reason"), [
    ({"name": "/"}, "the root"), ({"name": "a b", "value": 1}, "no legal name"), ({"value": 1}, "name is missing"),
    ({"name": "/a", "value": "x", "type": "float64"}, "a number is expected"),
    ({"name": "/a", "value": 10 ** 400, "type": "float64"}, "too large"),
    ({"name": "/a", "value": [1, "x"], "type": "float64_array"}, "a list of numbers"),
    ({"name": "/a", "value": "*", "type": "byte_array"}, "base64"),
    ({"name": "/a", "value": 1, "type": "int"}, "type is"),
    ({"name": "/a", "value": [None]}, "null"), ({"name": "/a", "value": {"b/c": 1}}, "no name"),
    ({"name": "/a", "value": "\0"}, "XML"), ({"name": "/a", "value": "\ud800"}, "XML"),
    ({"name": "/gone"}, "is not set")])
def test_a_parameter_that_cannot_be_set(lab, parameter, reason):
    client = lab.connect()
    client.send("setParameters", parameters=[parameter])
    assert reason in client.error() and lab.graph.tree == {}


def test_parameters_beyond_the_whitelist_are_neither_seen_nor_set():
    lab = made(rules=FoxgloveRules(parameters=compiled(["/mine(/.*)?"])))
    try:
        lab.graph.tree = {"mine": {"a": 1}, "other": {"b": 2}}
        client = lab.connect()
        client.send("getParameters", parameterNames=[])
        assert client.next("parameterValues")["parameters"] == [{"name": "/mine/a", "value": 1}]
        client.send("getParameters", parameterNames=["/other", "/other/b", "/mine"])
        assert client.next("parameterValues")["parameters"] == [{"name": "/mine", "value": {"a": 1}}]
        for parameter in ({"name": "/other/b", "value": 1}, {"name": "/other"}):
            client.send("setParameters", parameters=[parameter])
            assert "param_whitelist" in client.error()
        client.send("subscribeParameterUpdates", parameterNames=["/other/b"])
        assert "param_whitelist" in client.error()
        assert lab.graph.tree == {"mine": {"a": 1}, "other": {"b": 2}}
    finally:
        lab.close()


def test_the_connection_graph(lab):
    client = lab.connect()
    client.channel("/tick")
    client.send("subscribeConnectionGraph")
    first = client.next("connectionGraphUpdate")
    assert {"name": "/tick", "publisherIds": ["/robot"]} in first["publishedTopics"]
    assert first["subscribedTopics"] == first["removedTopics"] == []
    client.subscribe("/tick")
    lab.graph.services["/enable"] = ("std_srvs/SetBool", None)
    lab.bridge.look_soon()
    seen = client.next("connectionGraphUpdate")
    while not seen["advertisedServices"]:
        seen = client.next("connectionGraphUpdate")
    assert seen["advertisedServices"] == [{"name": "/enable", "providerIds": ["/robot"]}]
    # Its channel goes, and with it the subscription of this bridge.
    lab.graph.end_topic("/tick")
    assert client.until(lambda frame: frame.get("removedTopics"))["removedTopics"] == ["/tick"]
    client.send("unsubscribeConnectionGraph")
    client.echo()
    lab.graph.publish_topic("/new", "std_msgs/Int32")
    client.channel("/new")
    client.send("are you there")
    assert client.receive()["op"] == "status"


def test_time_is_sent_where_it_is_simulated():
    lab = made(sim_time=True)
    try:
        clients = [lab.connect(), lab.connect()]
        assert "time" in clients[0].receive()["capabilities"]
        wait_until(lambda: "/clock" in lab.graph.subscribers, "the subscription to /clock")
        for nsecs in range(100):
            lab.graph.send("/clock", Clock(clock=type(Clock().clock)(3, nsecs)))
        # Not each one; but the last.
        for client in clients:
            client.until(lambda frame: frame == {"op": 2, "data": struct.pack("<Q", 3_000_000_099)})
        late = lab.connect()
        assert late.next(2)["data"] == struct.pack("<Q", 3_000_000_099)
        for client in (*clients, late):
            client.socket.close()
        wait_until(lambda: "/clock" not in lab.graph.subscribers, "the end of the subscription")
    finally:
        lab.close()


def test_the_view_token_only_watches():
    lab = made(access=Access({"drive": True, "look": False}, names=[]))
    lab.graph.services["/enable"] = ("std_srvs/SetBool", None)
    try:
        for query, options in (("", {}), ("?token=x", {}), ("?token=drive", {"origin": "http://evil.example"})):
            with pytest.raises(websocket.WebSocketBadStatusException, match="403"):
                lab.connect(query, **options)
        driver, viewer = lab.connect("?token=drive"), lab.connect("?token=look")
        number = driver.service("/enable")
        assert viewer.receive()["capabilities"] == ["parameters", "parametersSubscribe", "connectionGraph", "assets"]
        viewer.send("advertise", channels=[])
        assert "view token" in viewer.error()
        viewer.publish(1, b"{}")
        assert "view token" in viewer.error()
        viewer.send("setParameters", parameters=[{"name": "/a", "value": 1}])
        assert "view token" in viewer.error()
        viewer.call(number, 1, SetBoolRequest(True))
        assert "view token" in viewer.next("serviceCallFailure")["message"]
        assert not viewer.services and lab.graph.tree == {}
        lab.graph.tree = {"bridge": {"token": "drive", "view_token": "look", "port": 1}, "video": {"token": "drive"}}
        for names in ([], ["/bridge"], ["/bridge/token"], ["/video/token"]):
            viewer.send("getParameters", parameterNames=names)
            assert "drive" not in str(viewer.next("parameterValues"))
        viewer.subscribe("/tick")
        lab.graph.send("/tick", Int32(3))
        assert viewer.message()[2] == struct.pack("<i", 3)
    finally:
        lab.close()


def test_a_capability_that_is_switched_off_is_refused():
    lab = made(rules=FoxgloveRules(capabilities=("parameters",)))
    try:
        client = lab.connect()
        assert client.receive()["capabilities"] == ["parameters"]
        for op, fields in (("advertise", {"channels": []}), ("subscribeConnectionGraph", {}),
                           ("subscribeParameterUpdates", {"parameterNames": []})):
            client.send(op, **fields)
            assert "does not offer" in client.error()
        client.send("fetchAsset", uri="package://a/b.stl", requestId=1)
        assert b"does not offer" in client.next(4)["data"]
    finally:
        lab.close()
