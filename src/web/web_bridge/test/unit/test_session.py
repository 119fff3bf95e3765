# SPDX-License-Identifier: BSD-3-Clause
"""The operations, through a live server in front of a fake graph, with a client of another implementation."""
import base64
import json
import threading

import cbor2
import pytest
from std_msgs.msg import Float64, Int32, Int64, String
from std_srvs.srv import SetBoolRequest, SetBoolResponse
from web_lab import WebLab

from lab_testing.waiting import wait_until
from web_bridge.access import Access, Rules
from web_bridge.errors import ServiceFailed
from web_bridge.frames import packed_png, split
from web_bridge.services import MAX_AT_ONCE


def values(lab, topic="/chatter"):
    return [message.data for name, message in lab.graph.published if name == topic]


def test_publish_and_subscribe(lab):
    speaker, hearer = lab.connect(), lab.connect()
    hearer.send("subscribe", topic="chatter", type="std_msgs/String")
    hearer.echo()
    speaker.send("advertise", topic="/chatter", type="std_msgs/String", id="advertise:1")
    speaker.send("publish", topic="/chatter", msg={"data": "hello"})
    # The topic is spelled as the client spelled it: roslibjs finds its callbacks by that.
    assert hearer.receive() == {"op": "publish", "topic": "chatter", "msg": {"data": "hello"}}


def test_publish_needs_no_advertise_where_the_type_is_known(lab):
    client = lab.connect()
    lab.graph.types["/known"] = "std_msgs/Int32"
    client.send("publish", topic="/known", msg={"data": 3})
    client.send("publish", topic="/unknown", msg={"data": 3}, id="p")
    status = client.receive()
    assert status == {"op": "status", "level": "error", "id": "p",
                      "msg": "publish: the type of /unknown is not known: advertise it first"}
    assert values(lab, "/known") == [3]


def test_a_wrong_message_is_not_published_and_its_sender_told(lab):
    client = lab.connect()
    client.send("advertise", topic="/a", type="std_msgs/Int32")
    client.send("publish", topic="/a", msg={"data": "three"}, id="x")
    status = client.receive()
    assert status["id"] == "x" and "data is 'three'; an integer is expected (int32)" in status["msg"]
    assert not lab.graph.published


@pytest.mark.parametrize(("operation", "text"), [
    ({"op": "dance"}, "unknown op 'dance'"), ({"op": ["x"]}, "unknown op"), ({}, "unknown op None"),
    ({"op": "publish"}, "the field topic is missing"), ({"op": "publish", "topic": 3}, "topic is 3; str is expected"),
    ({"op": "subscribe", "topic": "a b"}, "no legal name"),
    ({"op": "subscribe", "topic": "/a", "compression": 3}, "compression is 3"),
    ({"op": "subscribe", "topic": "/a", "throttle_rate": "fast"}, "throttle_rate is 'fast'"),
    ({"op": "subscribe", "topic": "/a", "queue_length": 10 ** 400}, "queue_length is 1000"),
    ({"op": "subscribe", "topic": "/a", "fragment_size": float("nan")},
     "fragment_size is nan; a number from -1e+12 to 1e+12 is"),
    ({"op": "advertise", "topic": "/a", "type": "nobody/Thing"}, "nobody/Thing"),
    ({"op": "set_level", "level": "loud"}, "level is 'loud'"), ({"op": "auth"}, "does not use rosauth"),
    ({"op": "subscribe", "id": {}, "topic": "/a"}, "id is {}"),
    ({"op": "call_service", "service": "/s", "id": float("nan")}, "id is nan"),
    ({"op": "advertise_service", "service": "/s", "type": "nobody/Thing"}, "nobody/Thing"),
    ({"op": "service_response", "id": "x", "service": "/s", "result": True}, "no service request with id 'x'"),
    ({"op": "png", "data": "AAAA"}, "a picture of 3 bytes cannot be read"), ({"op": "fragment"}, "a fragment needs"),
])
def test_what_is_wrong_is_told_and_the_connection_stays(lab, operation, text):
    client = lab.connect()
    client.socket.send(json.dumps(operation))
    status = client.receive()
    assert status["level"] == "error" and text in status["msg"] and len(status["msg"]) < 400
    client.echo()


def test_the_level_says_what_is_told(lab):
    client = lab.connect()
    client.send("unsubscribe", topic="/a")
    client.send("set_level", level="warning")
    client.send("unsubscribe", topic="/b")
    client.send("unadvertise", topic="/c")
    client.send("unadvertise_service", service="/d")
    assert [client.receive()["msg"].split()[0] for _ in range(3)] == [
        "unsubscribe:", "unadvertise:", "unadvertise_service:"]
    client.send("set_level", level="none")
    client.send("dance")
    client.send("set_level", level="error")
    assert "sing" in client.echo("sing")["msg"]


def test_operations_in_fragments_and_pictures(lab):
    client = lab.connect()
    client.send("advertise", topic="/a", type="std_msgs/String")
    publish = json.dumps({"op": "publish", "topic": "/a", "msg": {"data": "x" * 50}})
    for frame in split(packed_png(publish), 20):
        client.socket.send(frame)
    client.socket.send_binary(cbor2.dumps({"op": "publish", "topic": "/a", "msg": {"data": "y"}}))
    client.echo()
    assert values(lab, "/a") == ["x" * 50, "y"]
    for _ in range(6):
        publish = packed_png(publish)
    client.socket.send(publish)
    assert "packed into each other more than 3 times" in client.receive()["msg"]


def test_a_call_of_a_service(lab):
    client = lab.connect()
    lab.graph.services["/enable"] = ("std_srvs/SetBool", lambda request: SetBoolResponse(request.data, "on"))
    client.send("call_service", service="/enable", args={"data": True}, id="call:1")
    assert client.receive() == {"op": "service_response", "service": "/enable", "id": "call:1", "result": True,
                                "values": {"success": True, "message": "on"}}
    client.send("call_service", service="/enable", args=[False], compression="cbor")
    assert client.receive()["values"]["success"] is False
    client.send("call_service", service="/enable", compression="png")
    assert client.receive()["op"] == "png"
    client.send("call_service", service="/enable", fragment_size=-1)
    assert client.receive()["result"] is True
    client.send("call_service", service="/enable", args={"date": True})
    answer = client.receive()
    assert answer["result"] is False and "has no field 'date'" in answer["values"]
    client.send("call_service", service="/nowhere", id=7)
    assert client.receive() == {"op": "service_response", "service": "/nowhere", "id": 7, "result": False,
                                "values": "service /nowhere does not exist"}


def test_a_service_that_never_answers_holds_up_nothing(lab):
    client, release = lab.connect(), threading.Event()
    lab.graph.services["/slow"] = ("std_srvs/SetBool", lambda request: release.wait(60) and SetBoolResponse())
    lab.graph.services["/fast"] = ("std_srvs/SetBool", lambda request: SetBoolResponse(True, ""))
    for number in range(5):
        client.send("call_service", service="/slow", id=number)
    client.send("call_service", service="/fast", id="fast")
    assert client.receive()["id"] == "fast"
    release.set()
    assert {client.receive()["id"] for _ in range(5)} == set(range(5))


def test_calls_of_a_client_that_has_gone_take_no_place(lab):
    client, release = lab.connect(), threading.Event()
    asked = []
    lab.graph.services["/slow"] = ("std_srvs/SetBool", lambda request: asked.append(1) or release.wait(6000))
    for number in range(MAX_AT_ONCE + 1):
        client.send("call_service", service="/slow", id=number)
    wait_until(lambda: len(asked) == MAX_AT_ONCE, "the calls")
    client.socket.close()
    wait_until(lambda: not lab.bridge.calls.under_way, "the end of the calls")
    release.set()


def offer(lab, client, name="/offered"):
    client.send("advertise_service", service=name, type="std_srvs/SetBool")
    wait_until(lambda: name in lab.graph.offered, "the service")
    return lab.graph.offered[name]


def ask(handler, found):
    """Call a service that a client offers; its response or error goes into ``found``."""
    def call():
        try:
            found.append(handler(SetBoolRequest(True)))
        except ServiceFailed as error:
            found.append(str(error))
    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    return thread


def test_a_service_that_a_client_offers(lab):
    client, found = lab.connect(), []
    handler = offer(lab, client)
    threads = [ask(handler, found) for _ in range(2)]
    for _ in range(2):
        request = client.receive()
        assert request["op"] == "call_service" and request["args"] == {"data": True}
        client.send("service_response", id=request["id"], service=request["service"], result=True,
                    values={"success": True, "message": "yes"})
    for thread in threads:
        thread.join(90)
    assert found == [SetBoolResponse(True, "yes")] * 2


@pytest.mark.parametrize(("answer", "text"), [
    ({"result": False, "values": "no power"}, "no power"), ({"result": False}, "result false"),
    ({}, "result false"),
    ({"result": True, "values": {"success": 1}}, "the client's answer does not fit: success is 1")])
def test_a_client_that_cannot_answer(lab, answer, text):
    client, found = lab.connect(), []
    thread = ask(offer(lab, client), found)
    client.send("service_response", id=client.receive()["id"], service="/offered", **answer)
    thread.join(90)
    assert text in found[0]


@pytest.mark.parametrize("leave", ["close", "withdraw", "vanish"])
def test_callers_do_not_wait_for_a_client_that_has_gone(lab, leave):
    client, found = lab.connect(), []
    thread = ask(offer(lab, client), found)
    client.receive()
    if leave == "close":
        client.socket.close()
    elif leave == "withdraw":
        client.send("unadvertise_service", service="/offered")
    else:
        client.socket.sock.close()
    thread.join(90)
    assert found == ["the client that offered /offered has gone"]
    wait_until(lambda: not lab.graph.offered, "the end of the service")


def answer(client, request, message):
    client.send("service_response", id=request["id"], service=request["service"], result=True,
                values={"success": True, "message": message})


def test_a_service_is_its_last_clients(lab):
    """As with a page that was reloaded while its old connection lingers; the name may be spelled in another way."""
    first, second, found = lab.connect(), lab.connect(), []
    first.send("set_level", level="warning")
    thread = ask(offer(lab, first), found)
    old = first.receive()
    second.send("advertise_service", service="offered", type="std_srvs/SetBool")
    assert "another client offers the service offered" in first.receive()["msg"]
    answer(first, old, "of the first")
    thread.join(90)
    first.socket.close()
    thread = ask(lab.graph.offered["/offered"], found)
    answer(second, second.receive(), "of the second")
    thread.join(90)
    assert [response.message for response in found] == ["of the first", "of the second"]


def test_a_program_answers_and_withdraws_its_service_over_any_connection(lab):
    offering, other, found = lab.connect(), lab.connect(), []
    thread = ask(offer(lab, offering), found)
    answer(other, offering.receive(), "over another one")
    thread.join(90)
    assert found == [SetBoolResponse(True, "over another one")]
    other.send("unadvertise_service", service="/offered")
    wait_until(lambda: not lab.graph.offered, "the end of the service")


def test_a_client_that_only_watches_answers_and_withdraws_nothing():
    lab = WebLab(access=Access({"acts": True, "watches": False}, names=[]))
    try:
        offering, watching, found = lab.connect("?token=acts"), lab.connect("?token=watches"), []
        thread = ask(offer(lab, offering), found)
        request = offering.receive()
        answer(watching, request, "forged")
        watching.send("unadvertise_service", service="/offered")
        assert ["view token" in watching.receive()["msg"] for _ in range(2)] == [True, True]
        answer(offering, request, "mine")
        thread.join(90)
        assert found == [SetBoolResponse(True, "mine")]
    finally:
        lab.close()


def test_types_are_compared_by_their_sum_and_may_have_more_slashes(lab):
    client, other = lab.connect(), lab.connect()
    lab.graph.types["/tf"] = "tf2_msgs/TFMessage"
    client.send("subscribe", topic="/tf", type="tf/tfMessage")
    other.send("subscribe", topic="/tf", type="/tf2_msgs//TFMessage")
    for one in (client, other):
        one.echo()
    client.send("advertise", topic="/tf", type="tf/tfMessage")
    client.echo()
    other.send("advertise", topic="/tf", type="tf2_msgs/TFMessage")
    other.send("publish", topic="/tf", msg={"transforms": [{"child_frame_id": "hand"}]})
    assert [one.receive()["msg"]["transforms"][0]["child_frame_id"] for one in (client, other)] == ["hand", "hand"]
    client.send("advertise", topic="/tf", type="std_msgs/String")
    assert "/tf has the type" in client.receive()["msg"]


def test_what_rosbridge_suite_passes_over_is_told_as_a_warning(lab):
    client = lab.connect()
    client.send("set_level", level="warning")
    lab.graph.services["/enable"] = ("std_srvs/SetBool", lambda request: SetBoolResponse(request.data, "on"))
    for args, success in (([True, "more"], True), ("text", False), (3, False)):
        client.send("call_service", service="/enable#tag", args=args)
        assert "/enable: passed over" in client.receive()["msg"]
        found = client.receive()
        assert (found["id"], found["service"], found["values"]["success"]) == ("tag", "/enable#tag", success)
    client.send("call_service", service="/enable", id={"my": [1]})
    assert client.receive()["id"] == {"my": [1]}
    client.send("subscribe", topic="/a", type="std_msgs/Header", compression="zip")
    assert "passed over: compression is 'zip'" in client.receive()["msg"]
    # A page that speaks ROS 2's names, too.
    client.send("publish", topic="/a", id=["any"], latch=1, msg={"stamp": {"sec": 1, "nanosec": 2, "nsecs": 9}})
    assert "type of /a is not known" in client.receive()["msg"]
    client.send("advertise", topic="/a", type="std_msgs/Header", latch=1)
    client.send("publish", topic="/a", msg={"stamp": {"sec": 1, "nanosec": 2, "nsecs": 9}, "frame_id": "base"})
    found = [client.receive() for _ in range(2)]
    assert {one["op"]: one["msg"] for one in found}["publish"]["stamp"]["nsecs"] == 9
    assert "stamp is {'sec': 1" in {one["op"]: one["msg"] for one in found}["status"]


def test_bytes_are_sent_whatever_the_client_calls_them(lab):
    client = lab.connect()
    lab.graph.types["/a"] = "std_msgs/String"
    client.send("subscribe", topic="/a", type="nobody/Thing", compression="cbor-raw")
    client.echo()
    lab.graph.send("/a", String("hi"))
    assert client.receive()["msg"]["bytes"] == b"\2\0\0\0hi"


def test_a_client_takes_along_what_it_had(lab):
    client = lab.connect()
    client.send("advertise", topic="/a", type="std_msgs/Int32")
    client.send("subscribe", topic="/b")
    client.echo()
    assert lab.graph.subscribers and lab.graph.publishers
    client.socket.close()
    wait_until(lambda: not (lab.graph.subscribers or lab.graph.publishers or len(lab.clients)), "the end of everything")


def test_a_publisher_outlives_a_reload_of_the_page(lab):
    client = lab.connect()
    client.send("advertise", topic="/a", type="std_msgs/Int32", id=1)
    client.send("advertise", topic="/a", type="std_msgs/Int32", id=2)
    client.send("unadvertise", topic="/a", id=1)
    client.echo()
    publisher = lab.graph.publishers["/a"]
    client.send("unadvertise", topic="/a")
    client.send("advertise", topic="/a", type="std_msgs/Int32")
    client.echo()
    assert lab.graph.publishers["/a"] is publisher
    other = lab.connect()
    other.send("advertise", topic="/a", type="std_msgs/String")
    assert "/a has the type std_msgs/Int32, not std_msgs/String" in other.receive()["msg"]


def test_numbers_at_the_ends(lab):
    client = lab.connect()
    for topic, cls in (("/f", Float64), ("/i", Int64)):
        client.send("subscribe", topic=topic, type=cls._type)
    client.echo()
    lab.graph.send("/f", Float64(float("nan")))
    lab.graph.send("/i", Int64(2 ** 53 + 1))
    lab.graph.send("/f", Float64(float("-inf")))
    assert [client.receive()["msg"]["data"] for _ in range(3)] == [None, 2 ** 53 + 1, None]
    client.send("advertise", topic="/i", type="std_msgs/Int64")
    client.send("publish", topic="/i", msg={"data": 2 ** 53 + 1})
    client.send("publish", topic="/i", msg={"data": 2 ** 63})
    assert client.until(lambda frame: frame["op"] == "status")["msg"].startswith("publish: data is 9223372036854775808")
    assert values(lab, "/i") == [2 ** 53 + 1]


def test_a_picture_is_base64_and_comes_back(lab):
    client, data = lab.connect(), bytes(range(256))
    client.send("advertise", topic="/image", type="sensor_msgs/Image")
    client.send("publish", topic="/image", msg={"data": base64.b64encode(data).decode(), "encoding": "mono8"})
    client.echo()
    assert values(lab, "/image") == [data]


def test_topics_that_no_pattern_names_are_refused():
    lab = WebLab(rules=Rules(topics=("/open", "/also")))
    try:
        client = lab.connect()
        client.send("subscribe", topic="/closed")
        assert "topics_glob of this server does not allow the topic /closed" in client.receive()["msg"]
        client.send("subscribe", topic="open")
        client.echo()
        assert list(lab.graph.subscribers) == ["/open"]
    finally:
        lab.close()


def test_messages_of_two_topics_keep_their_order(lab):
    client = lab.connect()
    for topic in ("/a", "/b"):
        client.send("subscribe", topic=topic, type="std_msgs/Int32")
    client.echo()
    for number in range(100):
        lab.graph.send("/b" if number % 2 else "/a", Int32(number))
    assert [client.receive()["msg"]["data"] for _ in range(100)] == list(range(100))
    lab.graph.send("/a", String("another type"))
    assert client.receive()["msg"] == {"data": "another type"}
