# SPDX-License-Identifier: BSD-3-Clause
"""The data that a publisher, a service and the master's calls may send to a node."""
import io
import socket
import struct

import pytest
import rosgraph.network

from rospy_fixes.ports import limits, messages
from rospy_fixes.ports.messages import MessageTooLarge
from rospy_fixes.ports.registration import limited_update, read_header


def framed(data):
    return struct.pack("<I", len(data)) + data


def read(*portions):
    """(header, what is kept of the bytes behind it) of a connection on which ``portions`` come."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        for portion in portions:
            theirs.sendall(portion)
        theirs.shutdown(socket.SHUT_WR)
        kept = io.BytesIO(b"of an earlier connection")
        return read_header(ours, kept), kept.getvalue()


def test_a_header_is_read_and_the_message_behind_it_is_kept():
    header = framed(framed(b"md5sum=*") + framed(b"type=a=b"))
    assert read(header) == ({"md5sum": "*", "type": "a=b"}, b"")
    assert read(header[:3], header[3:] + b"a message") == ({"md5sum": "*", "type": "a=b"}, b"a message")


@pytest.mark.parametrize("data", [b"", b"\x01\0", struct.pack("<I", 9) + b"short"])
def test_a_header_that_ends_too_early_says_after_how_many_bytes(data):
    with pytest.raises(rosgraph.network.ROSHandshakeException, match="%d bytes" % len(data)):
        read(data)


def test_a_header_that_announces_too_much_is_not_waited_for():
    with pytest.raises(rosgraph.network.ROSHandshakeException, match=str(limits.HEADER_BYTES)):
        read(struct.pack("<I", limits.HEADER_BYTES + 1))


@pytest.mark.parametrize("publishers, found", [
    (["http://a:1/"] * (limits.PUBLISHERS + 1), str(limits.PUBLISHERS)), (["http://a:1/", "x\x01://y"], "x\\x01://y")])
def test_publishers_that_nobody_can_connect_to_are_refused(publishers, found):
    update = limited_update(lambda self, *arguments: (1, "", 0))
    code, text, _ = update(None, "/master", "/topic", publishers)
    assert code == -1 and found in text
    assert update(None, "/master", "/topic", ["http://a:1/"]) == (1, "", 0)
    assert update(None, "/master", "/topic", "no list") == update(None) == (1, "", 0)  # rospy answers these


def test_a_service_may_not_answer_more_than_a_message(monkeypatch):
    monkeypatch.setattr(messages, "largest_message_bytes", lambda: 100)
    taken = []
    read_answer = messages.checked_answer(lambda *arguments: taken.append(arguments))
    for is_fine in (0, 1):
        buffer = io.BytesIO()
        buffer.write(struct.pack("<BI", is_fine, 101))
        with pytest.raises(MessageTooLarge, match="101"):
            read_answer(None, buffer, [], None)
    for data in (b"", b"\x01", struct.pack("<BI", 1, 100)):
        buffer = io.BytesIO()
        buffer.write(data)
        read_answer(None, buffer, [], None)
    assert len(taken) == 3
