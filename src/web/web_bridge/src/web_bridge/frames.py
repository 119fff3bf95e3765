# SPDX-License-Identifier: BSD-3-Clause
"""Frames of a WebSocket to operations (dicts) and back: JSON, CBOR, PNG, fragments. No ROS."""
from __future__ import annotations

import base64
import binascii
import itertools
import json
import math
import struct
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Any

import cbor2

from web_bridge.errors import BridgeError, FrameError, shown
from web_bridge.values import from_tag

#: Fragments that are not complete: bytes and messages of one client; beyond, the oldest message is dropped.
MAX_BYTES_PENDING, MAX_PENDING = 64 << 20, 100
MAX_FRAGMENTS = 100000
#: Fragments of one message to a client; each takes time and memory beside its data, for all clients.
MAX_FRAGMENTS_SENT = 10000
#: Operations in one frame. Programs send one; a text of 64 MB can hold millions, which take gigabytes.
MAX_OPERATIONS = 10000
#: Lists and objects in one frame: an empty one is a byte or two of the frame, and a hundred times that in memory. A
#: marker with a point for each of a million places has as many.
MAX_CONTAINERS = 1000000
# Values in a binary frame that may have more of them: they are counted one by one.
_MAX_COUNTED = 2000000
_CONTAINER_HEADS = bytes(range(0x80, 0xC0))
#: What a fragment takes beside its data [bytes].
_FRAGMENT_BYTES = 200
#: The tags that cbor2 itself reads, of which no ROS message needs one. Some take hours for a small frame (fractions and
#: decimals of large integers), or make a large object of a small frame (references to shared values).
_CBOR2_TAGS = (0, 1, 2, 3, 4, 5, 25, 28, 29, 30, 35, 36, 37, 43, 52, 54, 100, 256, 258, 260, 261, 1004, 43000)
_DECODER = json.JSONDecoder()
_PNG = b"\x89PNG\r\n\x1a\n"


def json_text(values: dict[str, Any]) -> str:
    return json.dumps(values, separators=(",", ":"))


def read_frame(frame: str | bytes) -> list[dict[str, Any]]:
    """The operations of one frame: a text with one or more JSON objects, or bytes with one object in CBOR (or JSON).

    Raises FrameError.
    """
    if isinstance(frame, bytes):
        if frame[:1] != b"{":
            return [_read_cbor(frame)]
        try:
            frame = frame.decode("utf-8")
        except UnicodeDecodeError as error:
            raise FrameError("a frame of text that is no UTF-8: %s" % error) from None
    return _read_json(frame)


def _read_json(text: str) -> list[dict[str, Any]]:
    if text.count("[") + text.count("{") > MAX_CONTAINERS:
        raise FrameError("a frame with more than %d lists and objects" % MAX_CONTAINERS)
    found, at = [], 0
    try:
        while at < len(text):
            if text[at] in " \t\r\n\0":
                at += 1
                continue
            value, at = _DECODER.raw_decode(text, at)
            if len(found) == MAX_OPERATIONS:
                raise FrameError("a frame with more than %d operations" % MAX_OPERATIONS)
            found.append(_operation(value))
    except (ValueError, RecursionError) as error:
        if isinstance(error, FrameError):
            raise
        raise FrameError("%s is no JSON object: %s" % (shown(text), error)) from None
    if not found:
        raise FrameError("an empty frame; a JSON object with the key op is expected")
    return found


def _refused_tag(number: int) -> Callable[..., Any]:
    def refuse(value: Any, _immutable: bool):
        # It raises: the tag is none of a numeric array.
        return from_tag(cbor2.CBORTag(number, value))
    return refuse


_REFUSED_TAGS = {number: _refused_tag(number) for number in _CBOR2_TAGS}


def _read_cbor(data: bytes) -> dict[str, Any]:
    _limit_containers(data)
    try:
        return _operation(cbor2.loads(data, tag_hook=lambda tag, _immutable: from_tag(tag),
                                      semantic_decoders=_REFUSED_TAGS))
    except BridgeError:
        raise
    # A decoder of bytes from any client: whatever it raises is about these bytes.
    except Exception as error:
        if isinstance(error.__cause__, BridgeError):
            error = error.__cause__
        raise FrameError("a binary frame of %d bytes is no CBOR object: %s" % (len(data), error)) from None


def _limit_containers(data: bytes) -> None:
    """Raise FrameError where CBOR ``data`` has too many lists and objects; else leave everything to the decoder."""
    if len(data) - len(data.translate(None, _CONTAINER_HEADS)) <= MAX_CONTAINERS:
        return  # so many bytes at most begin one
    at = values = containers = 0
    while at < len(data):
        kind, extra = data[at] >> 5, data[at] & 31
        at += 1
        size = 1 << (extra - 24) if 24 <= extra <= 27 else 0
        number = int.from_bytes(data[at:at + size], "big") if size else extra
        at += size
        values += 1
        containers += kind in (4, 5)
        if kind in (2, 3) and extra < 28:
            at += number
        if containers > MAX_CONTAINERS or values > _MAX_COUNTED:
            raise FrameError("a frame with more than %d lists and objects, or %d values"
                             % (MAX_CONTAINERS, _MAX_COUNTED))


def _operation(value: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FrameError("%s is no JSON object" % shown(value))
    return value


def png_of(text: str) -> bytes:
    """A text as the pixels of an RGB picture, filled up with newlines: bytes of a PNG file."""
    data = text.encode("utf-8")
    pixels = math.ceil(len(data) / 3)
    width = max(1, math.isqrt(pixels))
    height = max(1, math.ceil(pixels / width))
    data = data.ljust(width * height * 3, b"\n")
    row = width * 3
    # A zero before each row: no filter.
    rows = b"".join(b"\0" + data[i:i + row] for i in range(0, len(data), row))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return _PNG + _chunk(b"IHDR", header) + _chunk(b"IDAT", zlib.compress(rows, 3)) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def text_of_png(data: bytes, largest: int) -> str:
    """The text of a picture that :func:`png_of` or another rosbridge program made; ``largest`` in bytes. Raises
    FrameError.
    """
    try:
        # Joined once: a picture may have millions of chunks.
        packed, (width, height, kind) = [], (0, 0, ())
        for name, content in _chunks(data):
            if name == b"IHDR":
                width, height, *kind = struct.unpack(">IIBBBBB", content)
            elif name == b"IDAT":
                packed.append(content)
        size = height * (width * 3 + 1)
        if kind != [8, 2, 0, 0, 0] or size > largest:
            raise ValueError("8-bit RGB up to %d bytes is read" % largest)
        rows = zlib.decompressobj().decompress(b"".join(packed), size)
        if len(rows) != size or any(rows[::width * 3 + 1]):
            raise ValueError("it is not complete, or its rows are filtered")
        row = width * 3 + 1
        return b"".join(rows[i + 1:i + row] for i in range(0, size, row)).decode("utf-8").rstrip("\n\0")
    except (ValueError, struct.error, zlib.error) as error:
        raise FrameError("a picture of %d bytes cannot be read: %s" % (len(data), error)) from None


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    if data[:8] != _PNG:
        raise ValueError("it is no PNG file")
    at = 8
    while at + 12 <= len(data):
        length, name = struct.unpack_from(">I4s", data, at)
        yield name, data[at + 8:at + 8 + length]
        at += 12 + length


_NUMBERS = itertools.count()


def split(text: str, size: int) -> list[str]:
    """A text as fragments (JSON texts) whose data have ``size`` characters at most; itself where it is not longer, or
    ``size`` is 0. Raises FrameError for too many.
    """
    if not size or len(text) <= size:
        return [text]
    if len(text) > size * MAX_FRAGMENTS_SENT:
        raise FrameError("in fragments of %d characters it would be more than %d; a larger fragment_size is needed"
                         % (size, MAX_FRAGMENTS_SENT))
    name, total = "fragment:%d" % next(_NUMBERS), math.ceil(len(text) / size)
    return [json_text({"op": "fragment", "id": name, "data": text[i * size:(i + 1) * size], "num": i, "total": total})
            for i in range(total)]


class Fragments:
    """Puts a client's fragments together. ``clock()`` in seconds; a message that stays incomplete is dropped after
    ``timeout_s``.
    """

    def __init__(self, clock: Callable[[], float], timeout_s: float) -> None:
        self._clock = clock
        self._timeout_s = timeout_s
        self._pending = OrderedDict()  # id -> [begin, total, {num: data}, bytes]

    def add(self, operation: dict[str, Any]) -> str | None:
        """The whole text when its last fragment comes, else None. Raises FrameError."""
        name, data = operation.get("id"), operation.get("data")
        num: Any = operation.get("num")
        total: Any = operation.get("total")
        if not isinstance(name, str | int) or not isinstance(data, str):
            raise FrameError("a fragment needs id and data, a text")
        # 0.11.17 itself sends total as a float.
        if not _whole(num) or not _whole(total) or not 0 <= num < total <= MAX_FRAGMENTS:
            raise FrameError("fragment %s of %s: num must be from 0 to total - 1, and total at most %d"
                             % (shown(num), shown(total), MAX_FRAGMENTS))
        self._forget()
        entry = self._pending.setdefault(name, [self._clock(), total, {}, 0])
        if entry[1] != total:
            del self._pending[name]
            raise FrameError("fragments of %s say total %s and %s" % (shown(name), entry[1], total))
        if num not in entry[2]:
            entry[2][num] = data
            entry[3] += len(data) + _FRAGMENT_BYTES
        if len(entry[2]) == total:
            del self._pending[name]
            return "".join(entry[2][i] for i in range(int(total)))
        return None

    def _forget(self) -> None:
        limit = self._clock() - self._timeout_s
        while self._pending:
            oldest = next(iter(self._pending.values()))
            held = sum(entry[3] for entry in self._pending.values())
            if oldest[0] >= limit and held <= MAX_BYTES_PENDING and len(self._pending) <= MAX_PENDING:
                return
            self._pending.popitem(last=False)


def _whole(number: Any) -> bool:
    return type(number) in (int, float) and number == number // 1


def from_base64(text: Any) -> bytes:
    """Bytes of a base64 text; raises FrameError."""
    try:
        return binascii.a2b_base64(text)
    except (ValueError, TypeError) as error:
        raise FrameError("data is no base64 text: %s" % error) from None


def packed_png(text: str, name: str | None = None) -> str:
    """A text as an operation png, itself a JSON text."""
    operation = {"op": "png", "data": base64.b64encode(png_of(text)).decode("ascii")}
    if name is not None:
        operation["id"] = name
    return json_text(operation)


def cbor(values: dict[str, Any]) -> bytes:
    return cbor2.dumps(values)
