# SPDX-License-Identifier: BSD-3-Clause
"""torture.py crowd: 60 clients, each of which reads the clock and the joint states and calls a service."""
import contextlib
import selectors
import threading
import time

from full import bear
from gazebo_msgs.srv import GetModelState, GetModelStateRequest
from limits import arm_limits
from message_spec import encode, spec_of
from robot import init_node
from tcpros import ServiceConnection, service_type
from watch import STATES, Watch, class_of, subscribe

from lab import Lab

CLIENTS = 60
STILL_RAD = 0.001
MINUTES = 2.0
CALL_S = 60.0


def run(options, journal):
    """Connect clients to a lab, and check that each gets its messages and answers; return figures for the result."""
    with Lab(options.out) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch, Crowd(lab) as crowd:
            begin, simulated = time.monotonic(), watch.simulated_s
            bear(lab, watch, options, journal, MINUTES if options.minutes is None else options.minutes)
            wall_s, simulated = time.monotonic() - begin, watch.simulated_s - simulated
        for number, count in enumerate(crowd.read):
            if count == 0:
                journal.fail("client %d read nothing" % number, options.seed, 0, 1)
        if crowd.problems:
            journal.fail("; ".join(crowd.problems[:5]), options.seed, 0, 1)
        return {"simulated_s": watch.simulated_s, "also": {
            "clients": CLIENTS, "services_called": crowd.calls, "part_of_real_time": round(simulated / wall_s, 3),
            "megabytes_read_by_a_client_least": round(min(crowd.read) / 1e6, 2)}}


class Crowd(threading.Thread):
    """Clients, each with its own connections. Attributes: read, bytes per client; calls; problems, texts."""

    def __init__(self, lab):
        super().__init__(name="crowd", daemon=True)
        self._selector, self._stack = selectors.DefaultSelector(), contextlib.ExitStack()
        self._ending, self._services = threading.Event(), []
        self.read, self.calls, self.problems = [0] * CLIENTS, 0, []
        name = "/gazebo/get_model_state"
        address = lab.service_address(name)
        _, md5sum = service_type(address, name)
        spec = spec_of(GetModelStateRequest, class_of)
        self._request = encode(spec, {"model_name": "baxter", "relative_entity_name": ""})
        self._answer_class = GetModelState._response_class
        for number in range(CLIENTS):
            for topic, kind in (("/clock", "rosgraph_msgs/Clock"), (STATES, "sensor_msgs/JointState")):
                connection = subscribe(lab, topic, kind, "/gazebo", "_%d" % number)
                self._stack.callback(connection.close)
                self._selector.register(connection, selectors.EVENT_READ, number)
            self._services.append(ServiceConnection(address, name, md5sum))
            self._stack.callback(self._services[-1].close)

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self._ending.set()
        self.join()
        self._stack.close()

    def run(self):
        number = 0
        while not self._ending.is_set():
            for key, _ in self._selector.select(0.05):
                self._read(key)
            self._call(number)
            number = (number + 1) % CLIENTS

    def _read(self, key):
        try:
            data = key.fileobj.recv(1 << 18)
        except OSError as error:
            data = b""
            self.problems.append("client %d: %s" % (key.data, error))
        if not data:
            self.problems.append("client %d: a connection was closed" % key.data)
            self._selector.unregister(key.fileobj)
        self.read[key.data] += len(data)

    def _call(self, number):
        try:
            is_fine, data = self._services[number].call(self._request, CALL_S)
        except Exception as error:  # any error is a result of the test
            self.problems.append("client %d: %s: %s" % (number, type(error).__name__, error))
            return
        answer = self._answer_class()
        if not is_fine or not answer.deserialize(data).success:
            self.problems.append("client %d: get_model_state: %s" % (number, data))
        self.calls += 1
