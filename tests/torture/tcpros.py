# SPDX-License-Identifier: BSD-3-Clause
"""The TCPROS protocol (http://wiki.ros.org/ROS/TCPROS) without rospy, so that any bytes can be sent. No ROS needed."""
import contextlib
import socket
import struct

_LENGTH = struct.Struct("<I")
HANDSHAKE_S = 60.0
LARGEST = 1 << 28


class ConnectionLost(Exception):
    """The other side closed the connection, or its answer is not TCPROS."""


def header(fields):
    """The bytes of a connection header. fields: dict of texts."""
    parts = [("%s=%s" % pair).encode() for pair in fields.items()]
    body = b"".join(_LENGTH.pack(len(part)) + part for part in parts)
    return _LENGTH.pack(len(body)) + body


def parsed(body):
    """Decode a header's bytes, without their length, to a dict. Raises ConnectionLost if they are not header."""
    fields, at = {}, 0
    while at < len(body):
        if at + _LENGTH.size > len(body):
            raise ConnectionLost("a header of %d bytes ends within a length" % len(body))
        length, = _LENGTH.unpack_from(body, at)
        key, equals, value = body[at + 4:at + 4 + length].partition(b"=")
        if not equals or at + 4 + length > len(body):
            raise ConnectionLost("a header's field is %r" % body[at:at + 4 + length][:40])
        fields[key.decode(errors="replace")] = value.decode(errors="replace")
        at += 4 + length
    return fields


def read_exactly(connection, count):
    """Read this many bytes. Raises ConnectionLost, TimeoutError."""
    if count > LARGEST:
        raise ConnectionLost("the other side announces %d bytes" % count)
    data = bytearray()
    while len(data) < count:
        try:
            more = connection.recv(min(count - len(data), 1 << 20))
        except ConnectionError as error:
            raise ConnectionLost(str(error)) from error
        if not more:
            raise ConnectionLost("closed after %d of %d bytes" % (len(data), count))
        data += more
    return bytes(data)


def read_block(connection):
    """Read a length and that many bytes."""
    return read_exactly(connection, _LENGTH.unpack(read_exactly(connection, 4))[0])


def handshake(address, fields, timeout_s=HANDSHAKE_S):
    """(connection, the other side's header). Raises ConnectionLost, OSError; TimeoutError after timeout_s [s]."""
    connection = socket.create_connection(address, timeout_s)
    try:
        connection.settimeout(timeout_s)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.sendall(header(fields))
        return connection, parsed(read_block(connection))
    except BaseException:
        connection.close()
        raise


def service_type(address, name):
    """(type, MD5 sum) that a service's node states."""
    fields = {"probe": "1", "md5sum": "*", "callerid": "/torture", "service": name}
    connection, answer = handshake(address, fields)
    connection.close()
    if "type" not in answer:
        raise ConnectionLost("%s does not say its type: %s" % (name, answer))
    return answer["type"], answer["md5sum"]


class ServiceConnection:
    """One persistent connection to a service."""

    def __init__(self, address, name, md5sum):
        self._address = address
        self._fields = {"callerid": "/torture", "service": name, "md5sum": md5sum, "persistent": "1"}
        self._connection = None

    def call(self, request, timeout_s):
        """Return (True, the answer's bytes) or (False, the error's text). Raises ConnectionLost if the connection ended
        without an answer, and TimeoutError after timeout_s [s]; the next call connects again."""
        try:
            if self._connection is None:
                self._connection, refusal = handshake(self._address, self._fields)
                if "error" in refusal:
                    raise ConnectionLost(refusal["error"])
            self._connection.settimeout(timeout_s)
            with contextlib.suppress(BrokenPipeError):
                self._connection.sendall(_LENGTH.pack(len(request)) + request)
            is_fine = read_exactly(self._connection, 1) == b"\x01"
            answer = read_block(self._connection)
            return (True, answer) if is_fine else (False, answer.decode(errors="replace"))
        except (ConnectionLost, OSError) as error:
            self.close()
            if isinstance(error, ConnectionError):
                raise ConnectionLost(str(error)) from error
            raise

    def close(self):
        """Close the connection; a later call opens it again."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None


def garbage(choose, port_is_xmlrpc=False):
    """Bytes as from a broken program, a port scanner or a browser. choose: a random.Random."""
    request = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n"
    call = b"<?xml version='1.0'?><methodCall><methodName>%s</methodName><params>%s</params></methodCall>"
    noise = bytes(choose.randrange(256) for _ in range(choose.choice((1, 3, 4, 100, 5000))))
    if port_is_xmlrpc:
        methods = (b"getPid", b"requestTopic", b"publisherUpdate", b"shutdownX", b"getBusInfo", b"__init__")
        method = choose.choice(methods)
        params = choose.choice((b"", b"<param><value><i4>1</i4></value></param>" * 3, b"<param/>", b"<param>" * 2000,
                                b"<param><value><string>" + b"a" * 100_000 + b"</string></value></param>",
                                b"<param><value><array><data>" * 500))
        body = choose.choice((call % (method, params), noise, b"", b"<" * 1000))
        length = choose.choice((len(body), len(body), 0, 10**9, -1))
        return choose.choice((request % length + body, b"GET / HTTP/1.0\r\n\r\n", noise, b"POST / HTTP/1.1\r\n"))
    fields = {"callerid": choose.choice(("/torture", "", "a" * 10_000)), "topic": choose.choice(("/clock", "\0", "")),
              "md5sum": choose.choice(("*", "0")), "type": choose.choice(("*", "std_msgs/Bool"))}
    whole = header(fields)
    return choose.choice((
        noise, whole, whole[:choose.randrange(len(whole))], _LENGTH.pack(2**32 - 1), _LENGTH.pack(10**9) + noise,
        _LENGTH.pack(8) + _LENGTH.pack(2**31) + b"a=b!", _LENGTH.pack(4) + _LENGTH.pack(0), b"GET / HTTP/1.0\r\n\r\n",
        header({"service": choose.choice(("/gazebo/pause_physics_", "", "\0")), "md5sum": "*", "callerid": "/t"}),
    ))
