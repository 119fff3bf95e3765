# SPDX-License-Identifier: BSD-3-Clause
import io
import json
import random
import time

import cbor2
import pytest
from PIL import Image

from web_bridge import frames
from web_bridge.errors import FrameError
from web_bridge.frames import Fragments, from_base64, packed_png, png_of, read_frame, split, text_of_png


def test_a_frame_holds_one_or_more_objects():
    assert read_frame('{"op": 1}\n {"op": 2}\0') == [{"op": 1}, {"op": 2}]
    assert read_frame(b'{"op": 1}') == read_frame(cbor2.dumps({"op": 1})) == [{"op": 1}]
    assert read_frame(cbor2.dumps({"a": cbor2.CBORTag(69, b"\1\0\2\0")})) == [{"a": [1, 2]}]


@pytest.mark.parametrize("frame", [
    "", "{", "[1]", "3", '{"op": 1} x', "[" * 100000, '{"a":' * 100000, b"", b"{\xff}", b"\xff", b"\x9b" + b"\xff" * 8,
    b"\x81" * 100000, cbor2.dumps([1]), cbor2.dumps({"a": cbor2.CBORTag(99, 1)}), b"\xbf", b"\xd8\x1c\x81\xd8\x1d\x00"],
    ids=lambda frame: repr(frame[:12]))
def test_anything_else_is_a_frame_error(frame):
    with pytest.raises(FrameError) as caught:
        read_frame(frame)
    assert len(str(caught.value)) < 400


def test_no_tag_but_those_of_numeric_arrays_is_read():
    # Among the others are fractions, whose numerator and denominator may take hours, and references, by which a small
    # frame becomes a large object.
    for number in (*range(64), *range(87, 2000), 43000):
        for value in (b"1234", "1", 1, [1, 2]):
            with pytest.raises(FrameError, match=r"CBOR tag \d+ is not read"):
                read_frame(cbor2.dumps({"a": cbor2.CBORTag(number, value)}))


def test_a_frame_of_millions_of_operations_is_refused():
    assert len(read_frame("{}" * frames.MAX_OPERATIONS)) == frames.MAX_OPERATIONS
    with pytest.raises(FrameError, match="more than 10000 operations"):
        read_frame("{}" * (frames.MAX_OPERATIONS + 1))


def test_a_large_integer_is_refused_without_a_traceback():
    with pytest.raises(FrameError, match="CBOR tag 2 is not read"):
        read_frame(cbor2.dumps({"a": 1 << 100000}))


def test_bytes_of_any_kind_only_raise_frame_errors():
    dice = random.Random(4)
    for _ in range(3000):
        data = dice.randbytes(dice.randrange(40))
        try:
            read_frame(data)
        except FrameError:
            pass


@pytest.mark.parametrize("text", ["a", '{"é": "你好"}', "x" * 10001])
def test_a_text_is_the_pixels_of_a_picture(text):
    data = png_of(text)
    # Another reader of PNG agrees.
    assert Image.open(io.BytesIO(data)).convert("RGB").tobytes().decode().rstrip("\n") == text
    assert text_of_png(data, 1 << 20) == text
    operation = json.loads(packed_png(text, "n"))
    assert text_of_png(from_base64(operation["data"]), 1 << 20) == text and operation["id"] == "n"


@pytest.mark.parametrize("data", [b"", b"abc", png_of("hello")[:40], png_of("x" * 100000)],
                         ids=["nothing", "no picture", "half", "too large"])
def test_other_pictures_are_refused(data):
    with pytest.raises(FrameError, match="a picture of"):
        text_of_png(data, 1000)


def test_a_picture_of_many_chunks_takes_no_longer():
    chunk = b"\0\0\0\1IDATa\0\0\0\0"
    begin = time.process_time()
    with pytest.raises(FrameError, match="a picture of"):
        text_of_png(png_of("hello")[:33] + b"\0\x40\0\0IDAT" + bytes((1 << 22) + 4) + 3000 * chunk, 1000)
    # A copy of the first one for each of the others takes ten times that.
    assert time.process_time() - begin < 3.0


@pytest.mark.parametrize("encode", [json.dumps, cbor2.dumps], ids=["json", "cbor"])
@pytest.mark.parametrize("thing", [{}, []], ids=["objects", "lists"])
def test_lists_and_objects_in_a_frame_have_a_limit(monkeypatch, encode, thing):
    monkeypatch.setattr(frames, "MAX_CONTAINERS", 1000)
    assert read_frame(encode({"a": [thing] * 998}))
    with pytest.raises(FrameError, match="more than 1000 lists and objects"):
        read_frame(encode({"a": [thing] * 999}))


@pytest.mark.parametrize("size", [10, 200, 60000, 70000])
def test_only_lists_and_objects_of_cbor_count_not_bytes_like_theirs(monkeypatch, size):
    monkeypatch.setattr(frames, "MAX_CONTAINERS", 6)
    found = {"data": b"\xa0" * size, "name": "\u0080" * size, "n": [2 ** 60, -2 ** 20, 200.5, None],
             "o": {"p": []}}
    assert read_frame(cbor2.dumps(found)) == [found]
    monkeypatch.setattr(frames, "MAX_CONTAINERS", 3)
    with pytest.raises(FrameError, match="more than 3 lists"):
        read_frame(cbor2.dumps(found))
    monkeypatch.setattr(frames, "_MAX_COUNTED", 12)
    with pytest.raises(FrameError, match="or 12 values"):
        read_frame(cbor2.dumps({"data": b"\xa0" * size, "n": list(range(20))}))


def test_fragments_are_put_together_in_any_order():
    fragments = Fragments(lambda: 0.0, 10.0)
    pieces = [json.loads(piece) for piece in split("0123456789", 3)]
    assert [piece["total"] for piece in pieces] == [4] * 4
    assert split("012", 3) == ["012"] and split("0123", 0) == ["0123"]
    dice = random.Random(1)
    dice.shuffle(pieces)
    found = [fragments.add(piece) for piece in pieces]
    assert found == [None] * 3 + ["0123456789"]


def test_half_a_message_is_forgotten_after_a_while():
    time = [0.0]
    fragments = Fragments(lambda: time[0], 10.0)
    fragments.add({"id": "a", "data": "x", "num": 0, "total": 2.0})
    time[0] = 10.1
    fragments.add({"id": "b", "data": "x", "num": 0, "total": 2})
    assert fragments.add({"id": "a", "data": "y", "num": 1, "total": 2}) is None


def test_halves_do_not_pile_up():
    fragments = Fragments(lambda: 0.0, 10.0)
    for number in range(500):
        fragments.add({"id": number, "data": "x" * 1000, "num": 0, "total": 2})
    assert len(fragments._pending) <= 101


def test_empty_fragments_do_not_pile_up(monkeypatch):
    # Of 64 MiB it would need too many.
    monkeypatch.setattr(frames, "MAX_BYTES_PENDING", 10_000)
    fragments = Fragments(lambda: 0.0, 10.0)
    for number in range(2000):
        fragments.add({"id": number // 20, "data": "", "num": number % 20, "total": 21})
    assert sum(len(entry[2]) for entry in fragments._pending.values()) <= 100


@pytest.mark.parametrize("operation", [
    {}, {"id": "a"}, {"id": "a", "data": 3, "num": 0, "total": 1}, {"id": "a", "data": "x", "num": 2, "total": 2},
    {"id": "a", "data": "x", "num": 0.5, "total": 2}, {"id": "a", "data": "x", "num": 0, "total": 1e9},
    {"id": "a", "data": "x", "num": -1, "total": 2}, {"id": [], "data": "x", "num": 0, "total": 2},
    {"id": "a", "data": "x", "num": float("nan"), "total": 2}])
def test_a_fragment_without_its_fields_is_refused(operation):
    with pytest.raises(FrameError):
        Fragments(lambda: 0.0, 10.0).add(operation)


def test_fragments_that_disagree_are_refused():
    fragments = Fragments(lambda: 0.0, 10.0)
    fragments.add({"id": "a", "data": "x", "num": 0, "total": 2})
    with pytest.raises(FrameError, match="total 2 and 3"):
        fragments.add({"id": "a", "data": "x", "num": 1, "total": 3})
