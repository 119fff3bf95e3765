# SPDX-License-Identifier: BSD-3-Clause
import inspect

import pytest
from rospy.impl import tcpros_base
from rospy.impl.tcpros_pubsub import TCPROSSub
from rospy.impl.tcpros_service import TCPROSServiceClient
from std_msgs.msg import String
from std_srvs.srv import Empty

from rospy_fixes import refused_connections

REASON = {"error": "topic types do not match"}


@pytest.fixture
def said(monkeypatch):
    """The log of connections of a module that was amended once."""
    lines = []
    monkeypatch.setattr(tcpros_base, "logerr", lambda text, *args: lines.append(text % args))
    monkeypatch.setattr(tcpros_base.TCPROSTransport, "_validate_header",
                        inspect.unwrap(tcpros_base.TCPROSTransport._validate_header))
    refused_connections.amend(tcpros_base)
    return lines


def answered(protocol, header, publisher="/talker"):
    connection = tcpros_base.TCPROSTransport(protocol, protocol.resolved_name)
    connection.set_endpoint_id(publisher)
    connection._validate_header(header)
    return connection


def test_an_answer_for_the_terminal_is_only_shown(said):
    with pytest.raises(tcpros_base.TransportInitError):
        answered(TCPROSSub("/chatter", String), {"error": "\x1b[2Jno\nsuch topic"})
    assert said[0].isprintable() and "\\x1b[2Jno\\nsuch topic" in said[0]


def test_a_refusal_is_said_once_for_each_publisher(said):
    for publisher in ("/talker", "/talker", "/other"):
        with pytest.raises(tcpros_base.TransportInitError, match="do not match"):
            answered(TCPROSSub("/chatter", String), REASON, publisher)
    assert said == ["/chatter: no data from %s, which answers: topic types do not match" % each
                    for each in ("/talker", "/other")]


def test_who_is_let_in_says_nothing(said):
    header = {"md5sum": String._md5sum, "type": String._type}
    assert answered(TCPROSSub("/chatter", String), header).md5sum == String._md5sum
    assert said == []


def test_a_service_raises_its_refusal_and_says_nothing(said):
    with pytest.raises(tcpros_base.TransportInitError):
        answered(TCPROSServiceClient("/wave", Empty), REASON)
    assert said == []


def test_a_publisher_of_many_long_reasons_is_cut_short(said):
    for number in range(150):
        with pytest.raises(tcpros_base.TransportInitError):
            answered(TCPROSSub("/chatter", String), {"error": "%d %s" % (number, "x" * 10000)})
    assert len(said) == refused_connections.MAX_LINES
    assert max(map(len, said)) < 400
