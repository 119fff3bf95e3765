# SPDX-License-Identifier: BSD-3-Clause
"""torture.py garbage: bytes that are neither TCPROS nor XML-RPC, and connections that never complete a request."""
import contextlib
import random
import socket
import time
import xmlrpc.client

from limits import arm_limits
from robot import LabError, Robot, init_node
from tcpros import garbage
from watch import Watch

from lab import CALLER, Lab, address_of

STILL_RAD = 0.001
BATCH = 50
# Number of connections that stay open without a complete request during the test.
IDLE = 100
CONNECT_S = 60.0


def run(options, journal):
    """Write to every port of every node; return figures for the result."""
    with Lab(options.out) as lab:
        init_node()
        with Watch(lab, arm_limits(), STILL_RAD, options.seed) as watch, contextlib.ExitStack() as idle:
            robot = Robot(watch)
            robot.come_to_rest()
            processes, ports = lab.processes(), ports_of(lab)
            idlers = []
            for first in range(options.first, options.first + options.messages, BATCH):
                if options.until is not None and time.monotonic() > options.until:
                    break
                robot.come_to_rest()
                watch.still.arm(robot.positions())
                count = min(BATCH, options.first + options.messages - first)
                try:
                    for index in range(first, first + count):
                        choose = random.Random("%d/%d" % (options.seed, index))
                        node, kind, address = choose.choice(ports)
                        data = garbage(choose, kind == "XML-RPC")
                        journal.note(index, "%s %s" % (node, kind), "garbage", data)
                        connection = write(address, data, stays=choose.random() < 0.3)
                        if connection is not None:
                            idlers.append(idle.enter_context(contextlib.closing(connection)))
                        if len(idlers) > IDLE:
                            idlers.pop(0).close()
                    watch.still.disarm()
                    robot.follow()
                    dead = [node for node, pid in processes.items() if lab.pid(node) != pid]
                    problems = watch.take_found() + ["%s died or does not answer" % node for node in dead]
                except (LabError, OSError) as error:
                    problems = [*watch.take_found(), "%s: %s" % (type(error).__name__, error)]
                if problems:
                    journal.fail("; ".join(problems[:5]), options.seed, first, count)
                    if any("died" in text for text in problems):
                        break
            return {"simulated_s": watch.simulated_s, "also": {
                "ports": len(ports), "connections_left_open_at_a_time": IDLE,
                "farthest_an_arm_moved_rad": round(watch.still.farthest, 6)}}


def ports_of(lab):
    """[(node, "XML-RPC" or "TCPROS", address)] of all nodes of a lab."""
    found = set()
    for node in lab.nodes():
        uri = lab.master.lookupNode(CALLER, node)[2]
        found.add((node, "XML-RPC", address_of(uri)))
    for service, node in lab.services():
        with contextlib.suppress(KeyError):
            found.add((node, "TCPROS", lab.service_address(service)))
    for topic, _, node in lab.publications():
        if not any(row[:2] == (node, "TCPROS") for row in found):
            with contextlib.suppress(OSError, xmlrpc.client.Error), \
                    xmlrpc.client.ServerProxy(lab.master.lookupNode(CALLER, node)[2]) as proxy:
                protocol = proxy.requestTopic(CALLER, topic, [["TCPROS"]])[2]
                if protocol:
                    found.add((node, "TCPROS", (protocol[1], protocol[2])))
    return sorted(found)


def write(address, data, stays):
    """Connect and write; return the connection if it stays open. A node may close it at any time."""
    connection = socket.create_connection(address, CONNECT_S)
    with contextlib.suppress(OSError):
        connection.settimeout(CONNECT_S)
        connection.sendall(data)
    if stays:
        return connection
    connection.close()
    return None
