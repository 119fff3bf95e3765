# SPDX-License-Identifier: BSD-3-Clause
"""Bytes for the ports of a node: handshakes, calls of XML-RPC, requests of services, what a hostile publisher answers.
No ROS needed; the same seed gives the same bytes."""
import struct
import xmlrpc.client

from hostile import damaged, hostile_text
from tcpros import header

#: Where the bytes go, each with its share of the inputs.
KINDS = {"topic": 25, "service": 25, "request": 20, "xmlrpc": 25, "publisher": 5}
TOPIC, SERVICE, HEARD = "/echo", "/serve", "/heard"
MD5SUMS = {"topic": "992ce8a1687cec8c8bd883ec73ca41d1", "service": "09fb03525b03e7ea1fd3992bafd87e16",
           "publisher": "992ce8a1687cec8c8bd883ec73ca41d1"}
_LENGTH = struct.Struct("<I")
# What other nodes call. To end a node is what `shutdown` is for.
METHODS = ("getBusInfo", "getBusStats", "getMasterUri", "getName", "getPid", "getPublications", "getSubscriptions",
           "getUri", "paramUpdate", "publisherUpdate", "requestTopic", "system.listMethods", "system.methodHelp",
           "system.multicall", "reg_man", "protocol_handlers", "masterUri", "remappings", "__init__", "")
# Nobody listens there, so no thread tries for long.
NOWHERE = "http://127.0.0.1:1/"


def drawn(choose):
    """(kind, its bytes) of one input. choose: a random.Random."""
    kind = choose.choices(tuple(KINDS), tuple(KINDS.values()))[0]
    if kind == "xmlrpc":
        return kind, post(call(choose), choose)
    if kind == "request":
        return kind, header(fields("service", choose, 0.0)) + request(choose)
    return kind, spoiled(header(fields(kind, choose, 0.5)), choose)


def fields(kind, choose, wrong):
    """The fields of a handshake; ``wrong``: the probability that one or more are not as they should be."""
    found = {"callerid": "/torture", "md5sum": choose.choice((MD5SUMS[kind], "*")), "type": "std_msgs/String"}
    if kind == "service":
        found |= {"service": SERVICE, "persistent": choose.choice("01"), "probe": choose.choice("001")}
    else:
        found |= {"topic": TOPIC, "tcp_nodelay": "1", "latching": choose.choice("01")}
    while choose.random() < wrong:
        name = choose.choice((*found, "error", "message_definition"))
        found[name] = _text(choose)
        if choose.random() < 0.3:
            del found[choose.choice(tuple(found))]
    return found


def spoiled(data, choose):
    """The bytes of a handshake, any of them wrong, or cut off, or with wrong lengths; some stay as they are."""
    way = choose.randrange(8)
    if way == 0:
        return data
    if way == 1:
        return damaged(data, choose)
    changed = bytearray(data)
    if way == 2:  # the length of all, or of a field
        at = choose.choice(_lengths(data))
        changed[at:at + 4] = _LENGTH.pack(choose.choice((0, 1, 3, len(data), len(data) - 5, 2**18, 2**31, 2**32 - 1)))
    elif way == 3:
        at = choose.randrange(4, len(data))
        changed[at:at] = bytes(choose.randrange(256) for _ in range(choose.randrange(1, 9)))
        changed[:4] = _LENGTH.pack(len(changed) - 4)
    else:
        changed[choose.randrange(4, len(data))] = choose.choice((0, 0x80, 0xC3, 0xFF, 0x3D, choose.randrange(256)))
    return bytes(changed)


def request(choose):
    """A request of a service with one truth value."""
    body = bytes(choose.randrange(256) for _ in range(choose.choice((0, 1, 1, 1, 2, 9, 300))))
    return choose.choice((_LENGTH.pack(len(body)), _LENGTH.pack(len(body)), _LENGTH.pack(2**32 - 1),
                          _LENGTH.pack(len(body) + 1), b"\x01")) + body


def call(choose):
    """The XML of a call: of a method with values that may be of any type, in part damaged."""
    method = choose.choice(METHODS)
    values = [value(choose, 0) for _ in range(choose.choice((0, 1, 2, 3, 3, 3, 4, 9)))]
    if choose.random() < 0.5:
        values = ["/torture", choose.choice((TOPIC, HEARD)), choose.choice((
            [NOWHERE], [], [["TCPROS"]], [[]], [["UDPROS", b"x", 1]], ["", "x://y"], value(choose, 0)))]
    try:
        xml = xmlrpc.client.dumps(tuple(values), method, allow_none=True).encode("utf-8", "surrogatepass")
    except (OverflowError, TypeError, UnicodeError):
        xml = b"<methodCall><methodName>getPid"
    if choose.random() < 0.4:
        xml = damaged(xml, choose)
    return choose.choice((xml, xml, xml, b"<a>" * 5000, b"", b"\x1f\x8b" + xml))


def value(choose, depth):
    """A value of XML-RPC."""
    kind = choose.randrange(9 if depth < 3 else 6)
    if kind < 3:
        return _text(choose)
    if kind < 6:
        return choose.choice((0, -1, 2**31 - 1, True, None, 1e308, float("nan"), b"\xff\0", "", NOWHERE))
    if kind == 8:
        return {_text(choose): value(choose, depth + 1), "methodName": choose.choice(METHODS), "params": []}
    return [value(choose, depth + 1) for _ in range(choose.choice((0, 1, 3, 20)))]


def post(body, choose):
    """The request of HTTP around a call."""
    lines = ["POST %s HTTP/1.1" % choose.choice(("/", "/RPC2", "/\x7f", "*")), "Host: x"]
    length = choose.choice((len(body), len(body), len(body), len(body), 0, len(body) + 5, -1, 10**12, "٣", "", "1e3"))
    lines.append("Content-Length: %s" % length)
    if choose.random() < 0.2:
        lines.append("%s: %s" % (choose.choice(("Content-Encoding", "Transfer-Encoding", "Connection", "Expect")),
                                 choose.choice(("gzip", "chunked", "close", "100-continue", "\0", "a" * 70_000))))
    return "\r\n".join([*lines, "", ""]).encode("utf-8", "surrogatepass") + body


def _text(choose):
    found = hostile_text(choose)
    found = found.decode("latin-1") if isinstance(found, bytes) else found
    # What a header cannot hold in UTF-8 comes in by `spoiled`.
    return found[:choose.choice((50, 3000))].encode("utf-8", "replace").decode("utf-8")


def _lengths(data):
    """Where the lengths stand in a correct handshake."""
    found, at = [0], 4
    while at < len(data):
        found.append(at)
        at += 4 + _LENGTH.unpack_from(data, at)[0]
    return found
