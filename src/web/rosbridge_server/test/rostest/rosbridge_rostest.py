#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The server on a real master: topics, services, parameters, actions; and the published clients, unmodified."""
import contextlib
import itertools
import json
import os
import socket
import subprocess
import sys
import threading
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import actionlib
import rosgraph
import rospy
import rosservice
import tf2_ros
import websocket
from actionlib.msg import TestAction, TestFeedback, TestResult
from geometry_msgs.msg import TransformStamped
from rosbridge_msgs.msg import ConnectedClients
from std_msgs.msg import Int32, Int64
from std_srvs.srv import SetBool, SetBoolResponse
from visualization_msgs.msg import (
    InteractiveMarker,
    InteractiveMarkerInit,
    InteractiveMarkerPose,
    InteractiveMarkerUpdate,
)

from lab_testing import web_clients
from lab_testing.skipping import skip
from lab_testing.waiting import stretched, wait_for_message, wait_until
from lab_testing.web_robot import NAMES, POSITIONS, WebRobot, address_of
from web_bridge.services import MAX_AT_ONCE, MAX_OF_ALL

HERE = Path(__file__).parent


class Client:
    def __init__(self, query="?token=drive", **options):
        self.socket = websocket.create_connection(address() + query, timeout=stretched(90), **options)

    def send(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def until(self, condition):
        """The first operation that fits."""
        while True:
            operation = json.loads(self.socket.recv())
            if condition(operation):
                return operation

    def call(self, service, /, **arguments):
        self.send("call_service", service=service, args=arguments, id="call")
        answer = self.until(lambda operation: operation.get("id") == "call")
        return answer["result"], answer["values"]


def address():
    return address_of("rosbridge_websocket")


class RobotOnTheGraph(WebRobot):
    """The robot's topics and services that the clients use."""

    def __init__(self):
        super().__init__()
        self._services = [
            rospy.Service("/lab/enable", SetBool, lambda request: SetBoolResponse(request.data, "enabled")),
            rospy.Service("/lab/ask_offered", SetBool, self._ask)]
        self._server = actionlib.SimpleActionServer("/lab/act", TestAction, self._act, auto_start=False)
        self._server.start()
        self._hold_out_the_hand()

    def _hold_out_the_hand(self):
        transform = TransformStamped(child_frame_id="hand")
        transform.header.frame_id = "base"
        transform.transform.translation.x, transform.transform.rotation.w = 0.25, 1.0
        self._transforms = tf2_ros.StaticTransformBroadcaster()
        self._transforms.sendTransform(transform)
        marker = InteractiveMarker(name="ball")
        marker.header.frame_id, marker.header.stamp = "hand", rospy.Time.now()
        marker.pose.position.x, marker.pose.orientation.w = 1.0, 1.0
        self._markers = rospy.Publisher("/lab/markers/update_full", InteractiveMarkerInit, latch=True, queue_size=1)
        self._markers.publish("lab", 1, [marker])
        self.changes = rospy.Publisher("/lab/markers/update", InteractiveMarkerUpdate, queue_size=10)

    def _ask(self, request):
        """Calls the service that a web client offers."""
        rospy.wait_for_service("/lab/offered", stretched(90))
        return rospy.ServiceProxy("/lab/offered", SetBool)(request.data)

    def heard_by_clients(self):
        """Connections to the action's feedback and result, each a number."""
        publishers = self._server.action_server.feedback_pub, self._server.action_server.result_pub
        return [number for number in (one.get_num_connections() for one in publishers) if number]

    def _act(self, goal):
        wait_until(lambda: len(self.heard_by_clients()) == 2, "feedback to be heard")
        self._server.publish_feedback(TestFeedback(goal.goal + 1))
        self._server.set_succeeded(TestResult(goal.goal + 2))


class RosbridgeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = RobotOnTheGraph()

    def check_clients_report(self, seen, name):
        self.assertEqual(seen["none"], [NAMES, POSITIONS])
        self.assertEqual(seen["echo"], "from " + name)
        self.assertEqual(seen["service"], {"success": True, "message": "enabled"})
        self.assertEqual(seen["answer"], {"success": True, "message": name})
        self.assertEqual(seen["param"], {"a": [1, 2.5, "x"]})
        self.assertEqual((seen["topics"], seen["type"]), (True, "sensor_msgs/JointState"))
        self.assertEqual(seen["action"], [6, 7])
        self.assertEqual(seen["tfService"], 0.25)

    def check_roslib(self, name):
        try:
            folder = web_clients.of_npm()
        except web_clients.NotThere as error:
            skip(self, str(error))
        seen = self.report(["node", HERE / "roslib_client.mjs", folder, name, address() + "?token=drive"])
        self.check_clients_report(seen, name)
        self.assertEqual([seen["png"], seen["cbor"]], [[NAMES, POSITIONS]] * 2)
        self.assertEqual(seen["cbor-raw"], [True, True])
        self.assertIn("/lab/nowhere does not exist", seen["missing"])
        self.assertEqual([seen[key] for key in ("offered", "deleted", "services", "nodes")], [True, None, True, True])
        self.assertEqual(seen["serviceType"], "std_srvs/SetBool")
        self.assertEqual(seen["details"]["header"]["frame_id"], "string")
        self.assertEqual(seen["actions"], ["/lab/act", "/tf2_web_republisher"])
        self.assertEqual(seen["tfAction"], 0.25)

    def report(self, command, **environment):
        wait_until(lambda: rosservice.get_service_node("/lab/offered") is None, "the end of the last client's service")
        # Feedback that goes to the last client's connection would be lost for this one.
        wait_until(lambda: not self.robot.heard_by_clients(), "the end of the last client's connections")
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=stretched(90),
                                  env={**os.environ, **environment})
        except subprocess.TimeoutExpired as error:
            self.fail("%s; it said: %s" % (error, (error.stderr or b"").decode()))
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return json.loads(done.stdout.splitlines()[-1])

    def test_roslib_1(self):
        self.check_roslib("roslib-1")

    def test_roslib_2(self):
        self.check_roslib("roslib-2")

    def test_roslibpy(self):
        try:
            folder = web_clients.of_pip()
        except web_clients.NotThere as error:
            skip(self, str(error))
        path = os.pathsep.join([str(folder), os.environ["PYTHONPATH"]])
        seen = self.report([sys.executable, HERE / "roslibpy_client.py", address() + "?token=drive"], PYTHONPATH=path)
        self.check_clients_report(seen, "roslibpy")

    def test_the_first_messages_are_not_lost(self):
        client, numbers = Client(), itertools.count()

        def heard():
            """The messages of a new topic; none where the machine takes more than its first second to connect."""
            topic, found = "/lab/first%d" % next(numbers), []
            rospy.Subscriber(topic, Int64, lambda message: found.append(message.data))
            client.send("advertise", topic=topic, type="std_msgs/Int64")
            for number in range(3):
                client.send("publish", topic=topic, msg={"data": 2 ** 53 + number})
            client.send("call_service", service="/lab/enable", args={"data": True}, id=topic)
            client.until(lambda operation: operation.get("id") == topic)
            client.send("publish", topic=topic, msg={"data": -1})
            with contextlib.suppress(AssertionError):
                wait_until(lambda: -1 in found, timeout_s=2.0)
            return [number for number in found if number >= 0] == [2 ** 53, 2 ** 53 + 1, 2 ** 53 + 2]
        wait_until(heard, "the first messages of a topic")
        client.socket.close()
        wait_until(lambda: not any("/lab/first" in topic for topic, _ in rospy.get_published_topics()), "their end")

    def test_a_latched_message_reaches_each_client(self):
        latched = rospy.Publisher("/lab/latched", Int32, latch=True, queue_size=1)
        latched.publish(7)
        for _ in range(2):
            client = Client()
            client.send("subscribe", topic="/lab/latched", type="std_msgs/Int32")
            self.assertEqual(client.until(lambda operation: operation["op"] == "publish")["msg"], {"data": 7})

    def test_a_publisher_that_comes_back_is_heard(self):
        client = Client("?token=look")
        client.send("subscribe", topic="/lab/restarted", type="std_msgs/Int32")
        for number in range(2):
            publisher = rospy.Publisher("/lab/restarted", Int32, latch=True, queue_size=1)
            publisher.publish(number)
            self.assertEqual(client.until(lambda operation: operation["op"] == "publish")["msg"], {"data": number})
            publisher.unregister()

    def test_a_page_that_cannot_answer_is_an_error_for_the_caller(self):
        client, other = Client(), Client()
        client.send("advertise_service", service="/lab/failing", type="std_srvs/SetBool")
        rospy.wait_for_service("/lab/failing", stretched(90))
        thread = threading.Thread(target=lambda: client.send(
            "service_response", service="/lab/failing", result=False, values="out of order",
            id=client.until(lambda operation: operation["op"] == "call_service")["id"]))
        thread.start()
        worked, text = other.call("/lab/failing", data=True)
        thread.join()
        self.assertFalse(worked)
        self.assertIn("out of order", text)

    def test_the_service_of_a_node_cannot_be_taken_over(self):
        client = Client()
        client.send("advertise_service", service="/lab/enable", type="std_srvs/SetBool")
        status = client.until(lambda operation: operation["op"] == "status")
        self.assertIn("the node %s offers the service /lab/enable already" % rospy.get_name(), status["msg"])
        self.assertEqual(rosservice.get_service_node("/lab/enable"), rospy.get_name())
        self.assertTrue(client.call("/lab/enable", data=True)[0])

    def test_the_service_of_a_crashed_node_is_free(self):
        with contextlib.closing(socket.socket()) as closed:
            closed.bind(("127.0.0.1", 0))
            uri = "rosrpc://127.0.0.1:%d" % closed.getsockname()[1]
            rosgraph.Master("/lab_crashed").registerService("/lab/crashed", uri, "http://127.0.0.1:1/")
            client = Client()
            client.send("advertise_service", service="/lab/crashed", type="std_srvs/SetBool")
            wait_until(lambda: rosservice.get_service_node("/lab/crashed") == "/rosbridge_websocket", "the new service")

    def test_calls_of_clients_that_have_gone_take_no_place(self):
        release, asked = threading.Event(), []
        service = rospy.Service("/lab/never", SetBool, lambda request: asked.append(1) or release.wait(stretched(60)))
        for clients in range(1, MAX_OF_ALL // MAX_AT_ONCE + 2):
            client = Client()
            for number in range(MAX_AT_ONCE):
                client.send("call_service", service="/lab/never", args={}, id=number)
            # The first client's calls are over by the time at which the last one's need their place.
            wait_until(lambda clients=clients: len(asked) == clients * MAX_AT_ONCE, "the calls")
            client.socket.close()
        wait_until(lambda: Client().call("/lab/enable", data=True)[0], "an answer to another client")
        release.set()
        service.shutdown()

    def test_subscriptions_of_a_client_that_has_gone_leave_no_descriptor(self):
        master, client = rosgraph.Master(rospy.get_name()), Client()
        pid = ServerProxy(master.lookupNode("/rosbridge_websocket")).getPid(rospy.get_name())[2]

        def descriptors():
            return len(os.listdir("/proc/%d/fd" % pid))

        def heard():
            return sum(name.startswith("/lab/nobody") for name, _ in master.getSystemState()[1])
        for number in range(200):
            client.send("subscribe", topic="/lab/nobody%d" % number, type="std_msgs/String")
        wait_until(lambda: heard() == 200, lambda: "200 subscriptions, not %d" % heard())
        most = descriptors()
        client.socket.close()
        wait_until(lambda: heard() == 0 and descriptors() < most - 180,
                   lambda: "%d descriptors, %d before" % (descriptors(), most))

    def test_the_clients_are_told(self):
        client = Client()
        wait_for_message("/connected_clients", ConnectedClients,
                         lambda message: any(one.ip_address == "127.0.0.1" for one in message.clients))
        wait_for_message("/client_count", Int32, lambda message: message.data >= 1)
        client.socket.close()

    def test_markers_reach_a_page_in_its_frame(self):
        def ball():
            found = client.call("/lab/markers/tunneled/get_init")[1]
            return [(one["header"]["frame_id"], one["pose"]["position"]["x"]) for one in found["msg"]["markers"]]
        client = Client()
        rospy.wait_for_service("/lab/markers/tunneled/get_init", stretched(90))
        wait_until(lambda: ball() == [("base", 1.25)], "the marker in the page's frame")
        topic = "/lab/markers/tunneled/update"
        client.send("subscribe", topic=topic, type="visualization_msgs/InteractiveMarkerUpdate")
        pose = InteractiveMarkerPose(name="ball")
        pose.header.frame_id, pose.header.stamp = "hand", rospy.Time.now()
        pose.pose.position.x, pose.pose.orientation.w = 2.0, 1.0
        wait_until(lambda: self.robot.changes.get_num_connections(), "the proxy")
        timer = rospy.Timer(rospy.Duration(0.1), lambda _: self.robot.changes.publish(
            InteractiveMarkerUpdate(server_id="lab", seq_num=2, type=InteractiveMarkerUpdate.UPDATE, poses=[pose])))
        seen = client.until(lambda operation: operation["op"] == "publish")["msg"]["poses"][0]
        timer.shutdown()
        self.assertEqual((seen["header"]["frame_id"], seen["pose"]["position"]["x"]), ("base", 2.25))
        self.assertEqual(ball(), [("base", 2.25)])

    def test_tokens(self):
        for query, options in (("", {}), ("?token=wrong", {}), ("?token=drive", {"origin": "http://evil.example"})):
            with self.assertRaisesRegex(websocket.WebSocketBadStatusException, "403"):
                Client(query, **options)
        viewer = Client("?token=look")
        self.assertIn("view token", viewer.call("/lab/enable", data=True)[1])
        self.assertEqual(viewer.call("/rosapi/topic_type", topic="/lab/state")[1], {"type": "sensor_msgs/JointState"})
        viewer.send("publish", topic="/lab/heard", msg={"data": "from a viewer"})
        self.assertIn("view token", viewer.until(lambda operation: operation["op"] == "status")["msg"])
        self.assertNotIn("from a viewer", self.robot.heard)
        rospy.set_param("/web_video_server/token", "drive")
        for name in ("/", "/rosbridge_websocket", "rosbridge_websocket/token", "/web_video_server/token"):
            self.assertNotIn('"drive"', viewer.call("/rosapi/get_param", name=name)[1]["value"], name)
        self.assertFalse([name for name in viewer.call("/rosapi/get_param_names")[1]["names"] if "token" in name])
        self.assertEqual(viewer.call("/rosapi/has_param", name="/rosbridge_websocket/token"), (True, {"exists": False}))

    def test_all_parameters_at_once(self):
        parameters = json.loads(Client().call("/rosapi/get_param", name="/")[1]["value"])
        self.assertEqual(parameters["rosapi"]["topics_glob"], rospy.get_param("/rosapi/topics_glob"))
        for name in ("", "/"):
            worked, text = Client().call("/rosapi/set_param", name=name, value="{}")
            self.assertFalse(worked)
            self.assertIn("is a namespace", text)

    def test_a_namespace_is_no_topic(self):
        client = Client()
        for op in ("subscribe", "advertise"):
            for name in ("", "/"):
                client.send(op, topic=name, type="std_msgs/String")
                self.assertIn("is a namespace", client.until(lambda operation: operation["op"] == "status")["msg"])
            client.send(op, topic="/lab/typed", type="std_msgs/_String")
            self.assertIn("message type", client.until(lambda operation: operation["op"] == "status")["msg"])

    def test_every_question_of_rosapi_is_answered(self):
        client = Client()
        answers = {
            "topics_for_type": ({"type": "sensor_msgs/JointState"}, {"topics": ["/lab/state"]}),
            "publishers": ({"topic": "/lab/state"}, {"publishers": [rospy.get_name()]}),
            "subscribers": ({"topic": "/lab/heard"}, {"subscribers": [rospy.get_name()]}),
            "services_for_type": ({"type": "rosapi/GetTime"}, {"services": ["/rosapi/get_time"]}),
            "service_node": ({"service": "/lab/enable"}, {"node": rospy.get_name()}),
            "service_providers": ({"service": "rosapi/GetTime"}, {"providers": ["/rosapi"]}),
            "service_host": ({"service": "/lab/enable"}, {"host": "localhost"}),
            "has_param": ({"name": "/rosapi/topics_glob"}, {"exists": True}),
            "search_param": ({"name": "topics_glob"}, {"global_name": "/rosapi/topics_glob"}),
            "get_param": ({"name": "/nowhere", "default": "[1]"}, {"value": "[1]"})}
        for name, (arguments, expected) in answers.items():
            self.assertEqual(client.call("/rosapi/" + name, **arguments), (True, expected), name)
        self.assertIn("/rosapi/topics_glob", client.call("/rosapi/get_param_names")[1]["names"])
        self.assertGreater(client.call("/rosapi/get_time")[1]["time"]["secs"], 0)
        self.assertIn("/lab/enable", client.call("/rosapi/node_details", node=rospy.get_name())[1]["services"])
        raw = client.call("/rosapi/topics_and_raw_types")[1]
        self.assertIn("float64[] position", raw["typedefs_full_text"][raw["topics"].index("/lab/state")])
        for part, field in (("request", "data"), ("response", "success")):
            details = client.call("/rosapi/service_%s_details" % part, type="std_srvs/SetBool")[1]["typedefs"]
            self.assertEqual(details[0]["fieldnames"][0], field)
        worked, text = client.call("/rosapi/message_details", type="nobody_msgs/Thing")
        self.assertFalse(worked)
        self.assertIn("nobody_msgs/Thing", text)


if __name__ == "__main__":
    import rostest
    rospy.init_node("rosbridge_test")
    rostest.rosrun("rosbridge_server", "rosbridge", RosbridgeTest)
