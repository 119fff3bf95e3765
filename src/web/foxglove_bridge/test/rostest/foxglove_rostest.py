#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The server on a real master under simulated time, driven by the published JavaScript client, unmodified."""
import json
import struct
import subprocess
import unittest
from pathlib import Path

import rospy
import websocket
from clock import BEGIN_S
from genpy.dynamic import generate_dynamic
from std_msgs.msg import Int32, String
from std_srvs.srv import SetBool, SetBoolResponse

from lab_testing import web_clients
from lab_testing.skipping import skip
from lab_testing.waiting import stretched, wait_until
from lab_testing.web_robot import NAMES, POSITIONS, WebRobot, address_of

HERE = Path(__file__).parent
#: A type that no package of this machine has.
STRANGE = generate_dynamic("nobody_msgs/Thing", "int32 count\nstring[] words\n")["nobody_msgs/Thing"]


def address():
    return address_of("foxglove_bridge")


class RobotOnTheGraph(WebRobot):
    """The robot's topics and services that the client uses."""

    def __init__(self):
        super().__init__()
        self._latched = rospy.Publisher("/lab/latched", Int32, latch=True, queue_size=1)
        self._latched.publish(7)
        self._strange = rospy.Publisher("/lab/strange", STRANGE, latch=True, queue_size=1)
        self._strange.publish(STRANGE(3, ["x", "y"]))
        self._services = [rospy.Service("/lab/enable", SetBool, self._enable),
                          rospy.Service("/lab/set_other", SetBool, self._set_other)]

    def _enable(self, request):
        if not request.data:
            raise rospy.ServiceException("out of order")
        return SetBoolResponse(True, "enabled")

    def _set_other(self, _request):
        rospy.set_param("/lab/other", "set by a node")
        return SetBoolResponse(True, "")


class FoxgloveTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = RobotOnTheGraph()

    def test_the_published_client(self):
        try:
            folder = web_clients.of_npm()
        except web_clients.NotThere as error:
            skip(self, str(error))
        before = rospy.get_time()
        done = subprocess.run(["node", HERE / "foxglove_client.mjs", folder, address() + "?token=drive"],
                              capture_output=True, text=True, timeout=stretched(120))
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        seen = json.loads(done.stdout.splitlines()[-1])
        self.assertEqual(seen["info"], {
            "name": "/foxglove_bridge", "encodings": ["ros1", "json"],
            "capabilities": ["clientPublish", "parameters", "parametersSubscribe", "services", "connectionGraph",
                             "assets", "time"]})
        self.assertEqual(seen["channel"], {"encoding": "ros1", "schemaName": "sensor_msgs/JointState",
                                           "schemaEncoding": "ros1msg"})
        self.assertEqual(seen["state"][:2], [NAMES, POSITIONS])
        # Simulated time everywhere.
        for when in (seen["state"][2], seen["received"], seen["clock"], seen["time"]):
            self.assertGreaterEqual(when, max(BEGIN_S, int(before)))
            # The bridge may have heard a message of /clock before this node.
            wait_until(lambda when=when: when <= rospy.get_time(), "%s s of simulated time" % when)
        self.assertEqual(seen["latched"], 7)
        self.assertEqual([seen["ros1"], seen["json"]], ["from ros1", "from json"])

    def test_a_publisher_that_comes_back_with_another_type_is_another_channel(self):
        client = websocket.create_connection(address() + "?token=look", timeout=stretched(90),
                                             subprotocols=["foxglove.sdk.v1"])
        numbers = []
        for message in (Int32(5), String("five")):
            publisher = rospy.Publisher("/lab/restarted", type(message), latch=True, queue_size=1)
            publisher.publish(message)
            channel = self.channel(client, "/lab/restarted", message._type)
            numbers.append(channel["id"])
            client.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel["id"]}]}))
            frame = self.binary(client)
            self.assertEqual(struct.unpack_from("<BI", frame), (1, 1))
            self.assertEqual(type(message)().deserialize(frame[13:]), message)
            publisher.unregister()
        self.assertNotEqual(*numbers)
        client.close()

    def channel(self, client, topic, type_name):
        while True:
            frame = client.recv()
            for channel in json.loads(frame).get("channels", ()) if isinstance(frame, str) else ():
                if (channel["topic"], channel["schemaName"]) == (topic, type_name):
                    return channel

    def binary(self, client):
        """The next message; the time is no message."""
        while True:
            frame = client.recv()
            if isinstance(frame, bytes) and frame[0] == 1:
                return frame

    def test_tokens(self):
        for query, options in (("", {}), ("?token=wrong", {}), ("?token=drive", {"origin": "http://evil.example"})):
            with self.assertRaisesRegex(websocket.WebSocketBadStatusException, "403"):
                websocket.create_connection(address() + query, subprotocols=["foxglove.websocket.v1"],
                                            timeout=stretched(90), **options)
        viewer = websocket.create_connection(address() + "?token=look", subprotocols=["foxglove.websocket.v1"],
                                             timeout=stretched(90))
        self.assertNotIn("clientPublish", json.loads(viewer.recv())["capabilities"])
        viewer.close()


if __name__ == "__main__":
    import rostest
    rospy.init_node("foxglove_test")
    rostest.rosrun("foxglove_bridge", "foxglove", FoxgloveTest)
