# SPDX-License-Identifier: BSD-3-Clause
"""Drives the published roslibpy (python3 roslibpy_client.py URL) and prints what it saw as JSON."""
import json
import sys
import threading

import roslibpy
from roslibpy.ros1 import actionlib
from roslibpy.tf import TFClient

SECONDS, AGAIN_S = 60, 1.0


class Waiting:
    """A callback that keeps its first argument."""

    def __init__(self):
        self._there = threading.Event()
        self._value = None

    def __call__(self, *values):
        if not self._there.is_set():
            self._value = values[0] if values else None
            self._there.set()

    def get(self):
        return self.get_repeating(lambda: None)

    def get_repeating(self, act):
        """Call ``act()`` now and again and again: until its subscriber is connected, a message is lost."""
        for _ in range(round(SECONDS / AGAIN_S)):
            act()
            if self._there.wait(AGAIN_S):
                return self._value
        raise TimeoutError("nothing came")


def main(url):
    ros = roslibpy.Ros(url)
    ros.run(timeout=SECONDS)
    seen, state, echo = {}, Waiting(), Waiting()
    topic = roslibpy.Topic(ros, "/lab/state", "sensor_msgs/JointState")
    topic.subscribe(state)
    seen["none"] = [state.get()["name"], state.get()["position"]]
    heard = roslibpy.Topic(ros, "/lab/heard", "std_msgs/String")
    # It is latched: what another client said may come first.
    roslibpy.Topic(ros, "/lab/echo", "std_msgs/String").subscribe(
        lambda message: message["data"].endswith("roslibpy") and echo(message["data"]))
    seen["echo"] = echo.get_repeating(lambda: heard.publish({"data": "from roslibpy"}))
    enable = roslibpy.Service(ros, "/lab/enable", "std_srvs/SetBool")
    seen["service"] = dict(enable.call(roslibpy.ServiceRequest({"data": True}), timeout=SECONDS))
    offered = roslibpy.Service(ros, "/lab/offered", "std_srvs/SetBool")

    def answer(request, response):
        response["success"], response["message"] = request["data"], "roslibpy"
        return True
    offered.advertise(answer)
    ask = roslibpy.Service(ros, "/lab/ask_offered", "std_srvs/SetBool")
    seen["answer"] = dict(ask.call(roslibpy.ServiceRequest({"data": True}), timeout=SECONDS))
    offered.unadvertise()
    param = roslibpy.Param(ros, "/lab/number")
    param.set({"a": [1, 2.5, "x"]}, timeout=SECONDS)
    seen["param"] = param.get(timeout=SECONDS)
    param.delete(timeout=SECONDS)
    seen["topics"] = "/lab/state" in ros.get_topics()
    seen["type"] = ros.get_topic_type("/lab/state")
    client = actionlib.ActionClient(ros, "/lab/act", "actionlib/TestAction")
    goal, feedback, result = actionlib.Goal(client, roslibpy.Message({"goal": 5})), Waiting(), Waiting()
    goal.on("feedback", feedback)
    goal.on("result", result)
    # A goal that comes twice counts once.
    seen["action"] = [feedback.get_repeating(goal.send)["feedback"], result.get()["result"]]
    tf = Waiting()
    TFClient(ros, fixed_frame="base", rate=20.0, topic_timeout=30000).subscribe("hand", tf)
    seen["tfService"] = tf.get()["translation"]["x"]
    print(json.dumps(seen), flush=True)
    ros.close()
    ros.terminate()


main(sys.argv[1])
