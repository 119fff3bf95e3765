# SPDX-License-Identifier: BSD-3-Clause
import asyncio
import struct
import threading
import zlib
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage, Image

from web_bridge import pictures
from web_bridge.pictures import EncodedImage, ImageForm, PictureError, content_type, decoded, encode

# Red, green above blue, white; wide enough that a Bayer pattern and a pair of pixels share a colour.
RED, GREEN, BLUE, WHITE = (0, 0, 255), (0, 255, 0), (255, 0, 0), (255, 255, 255)

# A PNG that says it has 30000 x 30000 pixels, 2.7 GB in colour.
HUGE = bytearray(cv2.imencode(".png", np.zeros((10, 10), np.uint8))[1].tobytes())
HUGE[16:24] = struct.pack(">II", 30000, 30000)
HUGE[29:33] = struct.pack(">I", zlib.crc32(HUGE[12:29]))
HUGE = bytes(HUGE)


def scene(height=16, width=24):
    """(height, width, 3), blue first: four coloured quarters."""
    pixels = np.zeros((height, width, 3), np.uint8)
    for rows, columns, colour in ((0, 0, RED), (0, 1, GREEN), (1, 0, BLUE), (1, 1, WHITE)):
        pixels[rows * height // 2:, columns * width // 2:] = colour
    pixels[height // 2:, :width // 2] = BLUE
    return pixels


def message(array, encoding, padding=0, is_bigendian=0):
    """An Image of an array (height, width, ...), with bytes of padding at the end of each row."""
    height, width = array.shape[:2]
    rows = np.ascontiguousarray(array).view(np.uint8).reshape(height, -1)
    rows = np.concatenate([rows, np.full((height, padding), 77, np.uint8)], axis=1)
    return Image(height=height, width=width, encoding=encoding, step=rows.shape[1], data=rows.tobytes(),
                 is_bigendian=is_bigendian)


def quarters(pixels):
    """The colours in the middle of the quarters."""
    height, width = pixels.shape[:2]
    return [tuple(int(x) for x in np.atleast_1d(pixels[row, column]))
            for row in (height // 4, 3 * height // 4) for column in (width // 4, 3 * width // 4)]


def bayer(name):
    """The scene through a colour filter; ``name``: the colours of its first two rows."""
    pixels, found = scene(), np.zeros((16, 24), np.uint8)
    for number, letter in enumerate(name):
        row, column = divmod(number, 2)
        found[row::2, column::2] = pixels[row::2, column::2, "bgr".index(letter)]
    return found


@pytest.mark.parametrize("padding", (0, 5))
@pytest.mark.parametrize(("encoding", "array"), [
    ("bgr8", scene()), ("8UC3", scene()), ("rgb8", scene()[:, :, ::-1]),
    ("rgb16", scene()[:, :, ::-1].astype(np.uint16) * 257),
    *(("bayer_%s8" % name, bayer(name)) for name in ("rggb", "bggr", "gbrg", "grbg"))])
def test_colours_stay_what_they_are(encoding, array, padding):
    if array.itemsize > 1:
        padding *= array.itemsize
    assert quarters(decoded(message(array, encoding, padding))) == [RED, GREEN, BLUE, WHITE]


@pytest.mark.parametrize(("encoding", "order"), [("bgra8", (0, 1, 2, 3)), ("rgba8", (2, 1, 0, 3))])
def test_a_png_keeps_what_is_transparent_and_a_jpeg_does_not(encoding, order):
    array = np.dstack([scene(), np.full((16, 24), 128, np.uint8)])[:, :, order]
    pixels = decoded(message(array, encoding))
    png = cv2.imdecode(np.frombuffer(encode(pixels, ImageForm("png", 3)), np.uint8), cv2.IMREAD_UNCHANGED)
    assert quarters(png) == [(*colour, 128) for colour in (RED, GREEN, BLUE, WHITE)]
    jpeg = cv2.imdecode(np.frombuffer(encode(pixels, ImageForm()), np.uint8), cv2.IMREAD_UNCHANGED)
    assert jpeg.shape == (16, 24, 3) and np.abs(np.int16(quarters(jpeg)) - [RED, GREEN, BLUE, WHITE]).max() < 30


def test_two_pixels_may_share_their_colours():
    luma = np.tile(np.uint8([0, 255] * 6), (16, 2))  # black and white in turns
    neutral = np.full((16, 24), 128, np.uint8)
    for encoding, channels in (("yuv422", (neutral, luma)), ("yuv422_yuy2", (luma, neutral))):
        pixels = decoded(message(np.dstack(channels), encoding))
        assert pixels.shape == (16, 24, 3)
        assert tuple(pixels[3, 0]) == (0, 0, 0) and tuple(pixels[3, 1]) == WHITE


@pytest.mark.parametrize(("kind", "encoding"), [
    ("<f4", "32FC1"), (">f4", "32FC1"), ("<f8", "64FC1"), ("<u2", "16UC1"), (">u2", "16UC1"), ("<i4", "32SC1")])
def test_distances_are_grey_and_the_farthest_is_white(kind, encoding):
    values = np.array([[0, 1000], [2000, 4000]], kind)
    found = decoded(message(values, encoding, is_bigendian=kind[0] == ">"))
    assert found.tolist() == [[0, 63], [127, 255]]


def test_no_distance_at_all_is_black():
    for values in (np.full((2, 2), np.nan), np.zeros((2, 2)), np.full((2, 2), -np.inf)):
        assert decoded(message(values.astype(np.float32), "32FC1")).tolist() == [[0, 0], [0, 0]]
    assert decoded(message(np.float32([[np.nan, 1], [np.inf, 2]]), "32FC1")).tolist() == [[0, 127], [0, 255]]


def test_grey_is_grey():
    assert decoded(message(np.uint8([[3, 200]]), "mono8")).tolist() == [[3, 200]]
    assert decoded(message(np.uint16([[3 << 8, 200 << 8]]), "mono16")).tolist() == [[3, 200]]


def test_a_compressed_image_is_read():
    data = cv2.imencode(".png", scene())[1].tobytes()
    assert quarters(decoded(CompressedImage(format="png", data=data))) == [RED, GREEN, BLUE, WHITE]


@pytest.mark.parametrize(("bad", "text"), [
    (Image(height=2, width=2, encoding="rgb8", step=5, data=bytes(10)), "2 x 2 pixels of rgb8 need 6 a row"),
    (Image(height=2, width=2, encoding="rgb8", step=6, data=bytes(11)), "it has 11 bytes, 6 a row"),
    (Image(height=0, width=2, encoding="rgb8", step=6), "2 x 0 pixels"),
    (Image(height=1, width=1, encoding="hsv8", step=3, data=bytes(3)), "'hsv8' is not known"),
    (Image(height=1, width=1, encoding="16FC1", step=3, data=bytes(3)), "'16FC1' is not known"),
    (Image(height=1, width=1, encoding="", step=3, data=bytes(3)), "'' is not known"),
    (Image(height=1, width=1, encoding="8UC2", step=2, data=bytes(2)), "two channels"),
    (CompressedImage(format="jpeg", data=b"no picture"), "10 bytes of format 'jpeg'"),
    (CompressedImage(format="png", data=HUGE), "at most 64000000"),
    (CompressedImage(format="jpeg"), "0 bytes")])
def test_what_cannot_be_shown_is_named(bad, text):
    with pytest.raises(PictureError) as caught:
        decoded(bad)
    assert text in str(caught.value)


def test_forms():
    pixels = scene()
    shown = cv2.imdecode(np.frombuffer(encode(pixels, ImageForm("png", 9, 12, 8, True)), np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == (8, 12, 3) and quarters(shown) == [WHITE, BLUE, GREEN, RED]
    assert len(encode(pixels, ImageForm(quality=10))) < len(encode(pixels, ImageForm(quality=95)))
    only_wide = cv2.imdecode(np.frombuffer(encode(pixels, ImageForm(width=48)), np.uint8), cv2.IMREAD_COLOR)
    assert only_wide.shape == (16, 48, 3)


@pytest.mark.parametrize(("text", "expected"), [
    ("rgb8; jpeg compressed bgr8", "image/jpeg"), ("jpg", "image/jpeg"), ("bgr8; png compressed ", "image/png")])
def test_the_type_of_compressed_data(text, expected):
    assert content_type(text) == expected
    with pytest.raises(PictureError):
        content_type("16UC1; compressedDepth")


def test_an_image_is_encoded_once_for_all_that_want_the_same(monkeypatch):
    encoded, reads = [], []
    monkeypatch.setattr(pictures, "encode", lambda pixels, form: encoded.append(form) or b"file")

    def read():
        reads.append(threading.current_thread())
        return message(scene(), "bgr8")
    small, large = ImageForm(width=2), ImageForm()

    async def ask():
        picture = EncodedImage(read, pool)
        return await asyncio.gather(*(picture.encoded(form) for form in (large, small, large, small, large)))
    with ThreadPoolExecutor(2) as pool:
        found = asyncio.run(ask())
    assert len(encoded) == 2 and set(encoded) == {large, small}
    assert len(reads) == 1 and reads[0] != threading.current_thread()
    assert {frame[:2] for frame in found} == {(b"file", "image/jpeg")}


def test_an_image_is_kept_in_a_limited_number_of_forms(monkeypatch):
    encoded = []
    monkeypatch.setattr(pictures, "encode", lambda pixels, form: encoded.append(form.width) or b"file")

    async def ask():
        picture = EncodedImage(lambda: message(scene(), "bgr8"), pool)
        for width in (*range(1, 1001), 1000, 1):
            assert (await picture.encoded(ImageForm(width=width))).data == b"file"
        return len(picture._frames)
    with ThreadPoolExecutor(2) as pool:
        assert asyncio.run(ask()) == pictures.MAX_FORMS
    assert encoded == [*range(1, 1001), 1]
