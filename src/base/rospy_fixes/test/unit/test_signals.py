# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C in the middle of rospy's work: the program's shutdown handlers run, and it ends."""
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from rospy_fixes.signals import Postponement

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))
DEADLINE_S = 60.0
# A program with one subscriber at the other end of `theirs`; `interrupt()` is Ctrl-C. If it hangs, it prints its
# threads and ends with 1.
PROGRAM = """
import faulthandler, os, signal, socket, struct, threading
import rospy
from rospy.impl.tcpros_base import TCPROSTransport, TCPROSTransportProtocol
from std_msgs.msg import String
faulthandler.dump_traceback_later(20.0, exit=True)
rospy.core.set_initialized(True)
rospy.core.register_signals()
publisher = rospy.Publisher("/t", String, queue_size=10)
ours, theirs = socket.socketpair()
transport = TCPROSTransport(TCPROSTransportProtocol("/t", None), "/t")
transport.socket = ours
threading.Thread(target=publisher.impl.add_connection, args=(transport,), daemon=True).start()
while not publisher.impl.has_connections():
    pass
interrupt = lambda: os.kill(os.getpid(), signal.SIGINT)
incoming = theirs.makefile("rb")
def read():
    length, = struct.unpack("<I", incoming.read(4))
    return incoming.read(length)[4:].decode()
"""


def run(program):
    done = subprocess.run([sys.executable, "-c", PROGRAM + program], capture_output=True, text=True, timeout=DEADLINE_S,
                          env={**os.environ, "PYTHONPATH": "%s:%s" % (OURS, os.environ.get("PYTHONPATH", ""))})
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.split()


@pytest.mark.parametrize("where", ["queue", "text"])
def test_a_handler_publishes_after_the_message_that_ctrl_c_interrupts(where):
    """While a queue is filled, and while a message is written."""
    assert run("""
class Queue(list):
    def append(self, entry):
        if %r == "queue": interrupt()
        super().append(entry)
class Text(str):
    def encode(self, *arguments):
        if %r == "text": interrupt()
        return super().encode(*arguments)
publisher.impl.connections[0]._queue = Queue()
rospy.on_shutdown(lambda: publisher.publish("handler") or print(read(), read()))
publisher.publish(Text("loop"))
print("shut", "down" if rospy.is_shutdown() else "not")
""" % (where, where)) == ["loop", "handler", "shut", "down"]


def test_the_master_is_called_again_after_the_call_that_ctrl_c_interrupts():
    assert run("""
from xmlrpc.server import SimpleXMLRPCServer
master = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
master.register_function(lambda text: [text == "first" and interrupt(), text][1], "echo")
threading.Thread(target=master.serve_forever, daemon=True).start()
call = rospy.core.xmlrpcapi("http://127.0.0.1:%d" % master.server_address[1]).echo
rospy.on_shutdown(lambda: print(call("second")))
print(call("first"))
""") == ["second", "first"]


def test_a_handler_may_make_a_publisher_while_one_is_being_made():
    assert run("""
from rospy.impl.registration import RegistrationListener, get_registration_listeners
class Registrar(RegistrationListener):
    def reg_added(self, name, *_):
        print(name)
        if name == "/first": interrupt()
get_registration_listeners().add_listener(Registrar())
rospy.on_shutdown(lambda: rospy.Publisher("/second", String, queue_size=1))
rospy.Publisher("/first", String, queue_size=1)
""") == ["/first", "/second"]


def test_a_handler_runs_at_once_where_nothing_is_under_way():
    calls = []
    Postponement().of(lambda *arguments: calls.append(arguments))(signal.SIGINT, "frame")
    assert calls == [(signal.SIGINT, "frame")]


def test_handlers_run_once_and_in_turn_after_the_outermost_call():
    order, postponement = [], Postponement(DEADLINE_S)
    handle = postponement.of(lambda number, _: order.append(number))

    def inner():
        handle(1, None)
        handle(2, None)

    def outer():
        postponement.around(inner)()
        order.append("outer")
        raise ValueError

    with pytest.raises(ValueError):
        postponement.around(outer)()
    assert order == ["outer", 1, 2]


def test_a_call_that_does_not_end_postpones_for_a_while_only():
    handled, postponement = threading.Event(), Postponement(0.01)

    def stuck():
        postponement.of(lambda *_: handled.set())(signal.SIGINT, None)
        assert handled.wait(DEADLINE_S)

    postponement.around(stuck)()
    assert not postponement._pending


def test_other_threads_postpone_nothing():
    calls, postponement = [], Postponement(DEADLINE_S)
    handle = postponement.of(lambda number, _: calls.append(number))
    thread = threading.Thread(target=postponement.around(lambda: handle(1, None) or calls.append("end")))
    thread.start()
    thread.join(DEADLINE_S)
    assert calls == [1, "end"]
