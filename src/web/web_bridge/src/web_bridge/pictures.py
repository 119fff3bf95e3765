# SPDX-License-Identifier: BSD-3-Clause
"""Images of cameras to JPEG and PNG. No ROS: messages are objects with the fields of sensor_msgs/Image or
CompressedImage.
"""
from __future__ import annotations

import asyncio
import re
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np

from command_line.user_files import check_picture
from web_bridge.errors import BridgeError

if TYPE_CHECKING:
    from concurrent.futures.thread import ThreadPoolExecutor


#: Quality of a JPEG, 0 to 100, and compression of a PNG, 0 to 9, where a client does not say them.
JPEG_QUALITY, PNG_COMPRESSION = 95, 3
#: Forms in which one image is kept: each may have 50 MB, and clients may ask for any number of sizes.
MAX_FORMS = 8
#: Of a compressed image, which may be a thousandth of its pixels.
MAX_PIXELS = 64_000_000
_MACHINE_IS_BIG_ENDIAN = sys.byteorder == "big"
#: Encoding -> (bits of a channel, channels, conversion to OpenCV's order of colours or None).
_COLOURS = {
    "mono": (1, None), "bgr": (3, None), "bgra": (4, None), "rgb": (3, cv2.COLOR_RGB2BGR),
    "rgba": (4, cv2.COLOR_RGBA2BGRA),
    # OpenCV names a pattern by its second row and column, ROS by its first.
    "bayer_rggb": (1, cv2.COLOR_BayerBG2BGR), "bayer_bggr": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg": (1, cv2.COLOR_BayerGR2BGR), "bayer_grbg": (1, cv2.COLOR_BayerGB2BGR)}
_PAIRS = {"yuv422": cv2.COLOR_YUV2BGR_UYVY, "yuv422_yuy2": cv2.COLOR_YUV2BGR_YUY2}
_KINDS = {"U": "u", "S": "i", "F": "f"}


class PictureError(BridgeError):
    """An image that cannot be shown; the text says why."""


class ImageForm(NamedTuple):
    """How a client wants images: ``kind`` jpeg, png or original (a CompressedImage's bytes); ``width`` and ``height``
    in pixels, None: the image's own; ``is_turned``: by 180 degrees.
    """

    kind: str = "jpeg"
    quality: int = JPEG_QUALITY
    width: int | None = None
    height: int | None = None
    is_turned: bool = False


class Encoded(NamedTuple):
    """A file and its type; ``stamp``: the image's, as text in seconds."""

    data: bytes
    content_type: str
    stamp: str


class EncodedImage:
    """One image, encoded once for each form. ``read()`` returns the message or raises BridgeError; ``pool`` does the
    work.
    """

    def __init__(self, read: Callable[[], Any], pool: ThreadPoolExecutor) -> None:
        self._read = read
        self._pool = pool
        self._lock = threading.Lock()
        self._message: Any = None
        self._pixels: np.ndarray | None = None
        self._frames = {}

    async def encoded(self, form: ImageForm) -> Encoded:
        """The image in a form; in the loop. Raises BridgeError where it cannot be shown."""
        if form not in self._frames:
            self._frames[form] = asyncio.get_running_loop().run_in_executor(self._pool, self._encode, form)
            if len(self._frames) > MAX_FORMS:
                del self._frames[next(iter(self._frames))]
        # One client that goes away must not end the work for the others.
        return await asyncio.shield(self._frames[form])

    def _encode(self, form: ImageForm) -> Encoded:
        with self._lock:
            if self._message is None:
                self._message = self._read()
            pixels = self._pixels
            if pixels is None and form.kind != "original":
                pixels = self._pixels = decoded(self._message)
        stamp = self._message.header.stamp
        stamp = "%d.%06d" % (stamp.secs, stamp.nsecs // 1000)
        if pixels is None or form.kind == "original":
            return Encoded(bytes(self._message.data), content_type(self._message.format), stamp)
        return Encoded(encode(pixels, form), "image/" + form.kind, stamp)


def content_type(text: str) -> str:
    """The type of a CompressedImage's data by its field format, as "rgb8; jpeg compressed bgr8". Raises
    PictureError.
    """
    if "jpeg" in text or "jpg" in text:
        return "image/jpeg"
    if "png" in text:
        return "image/png"
    raise PictureError("its format is %r; jpeg and png can be shown" % text)


def decoded(message: Any) -> np.ndarray:
    """The pixels of a message: uint8 (height, width), or (height, width, 3 or 4) with blue first. Raises
    PictureError.

    Distances and other numbers (16UC1, 32FC1) become grey, the largest one white.
    """
    if not hasattr(message, "encoding"):
        pixels = None
        if message.data:
            try:
                check_picture(bytes(message.data), MAX_PIXELS)
            except OSError as error:
                raise PictureError("its %d bytes of format %r are not shown: %s" % (
                    len(message.data), message.format, error.strerror)) from None
            pixels = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
        if pixels is None:
            raise PictureError("its %d bytes of format %r are no JPEG or PNG" % (len(message.data), message.format))
        return _scaled(pixels) if pixels.dtype != np.uint8 else pixels
    name = message.encoding
    if name in _PAIRS:
        return cv2.cvtColor(_array(message, "u1", 2), _PAIRS[name])
    colours = re.fullmatch(r"([a-z_]+)(8|16)", name)
    if colours and colours[1] in _COLOURS:
        channels, conversion = _COLOURS[colours[1]]
        pixels = _array(message, "u%d" % (int(colours[2]) // 8), channels)
        if pixels.itemsize == 2:
            pixels = (pixels >> 8).astype(np.uint8)
        return pixels if conversion is None else cv2.cvtColor(pixels, conversion)
    numbers = re.fullmatch(r"(8|16|32|64)([USF])C?([1-4]?)", name)
    if numbers is None or (numbers[2] == "F" and int(numbers[1]) < 32):
        raise PictureError("its encoding %r is not known; sensor_msgs' names, such as rgb8 and 32FC1, are" % name)
    pixels = _array(message, _KINDS[numbers[2]] + str(int(numbers[1]) // 8), int(numbers[3] or 1))
    if pixels.ndim == 3 and pixels.shape[2] == 2:
        raise PictureError("its encoding %r has two channels; one, three or four can be shown" % name)
    return pixels if pixels.dtype == np.uint8 else _scaled(pixels)


def _array(message: Any, kind: str, channels: int) -> np.ndarray:
    """A view of the message's numbers (height, width[, channels]) in this machine's byte order."""
    numbers = np.dtype(kind)
    height, width, step, data = message.height, message.width, message.step, message.data
    if not (height and width and step >= width * channels * numbers.itemsize and len(data) >= step * height):
        raise PictureError("it has %d bytes, %d a row; %d x %d pixels of %s need %d a row" % (
            len(data), step, width, height, message.encoding, width * channels * numbers.itemsize))
    if bool(message.is_bigendian) != _MACHINE_IS_BIG_ENDIAN:
        numbers = numbers.newbyteorder()
    rows = np.frombuffer(data, np.uint8, step * height).reshape(height, step)[:, :width * channels * numbers.itemsize]
    pixels = np.ascontiguousarray(rows).view(numbers)
    if channels > 1:
        pixels = pixels.reshape(height, width, channels)
    return pixels if numbers.isnative else pixels.astype(numbers.newbyteorder("="))


def _scaled(values: np.ndarray) -> np.ndarray:
    """Numbers as grey, from 0 to the largest; what is no number is black."""
    values = np.nan_to_num(values.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    largest = float(values.max())
    return np.clip(values * (255 / max(largest, 1e-30)), 0, 255).astype(np.uint8)


def encode(pixels: np.ndarray, form: ImageForm) -> bytes:
    """The bytes of a JPEG or PNG of decoded pixels. Raises PictureError."""
    if form.is_turned:
        pixels = cv2.rotate(pixels, cv2.ROTATE_180)
    height, width = form.height or pixels.shape[0], form.width or pixels.shape[1]
    if (height, width) != pixels.shape[:2]:
        pixels = cv2.resize(pixels, (width, height))
    if form.kind == "png":
        options = [cv2.IMWRITE_PNG_COMPRESSION, form.quality]
    else:
        options = [cv2.IMWRITE_JPEG_QUALITY, form.quality]
        if pixels.ndim == 3 and pixels.shape[2] == 4:
            pixels = pixels[:, :, :3]
    try:
        return cv2.imencode("." + form.kind, np.ascontiguousarray(pixels), options)[1].tobytes()
    except cv2.error as error:
        raise PictureError("OpenCV cannot write it as %s: %s" % (form.kind, error)) from None
