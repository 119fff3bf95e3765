# SPDX-License-Identifier: BSD-3-Clause
"""A camera's stream of web_video_server: a thread keeps the newest picture."""
from __future__ import annotations

import io
import threading
import time
import urllib.parse
import urllib.request
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from PIL import Image

_HEADER_LINES, _PICTURE_BYTES = 50, 50_000_000


def parts(stream: BinaryIO) -> Iterator[bytes]:
    """The contents of a multipart stream whose parts have Content-Length. Raises ValueError for another one."""
    while True:
        length = None
        for _ in range(_HEADER_LINES):
            line = stream.readline()
            if not line:
                return
            name, _, value = line.decode("latin-1").partition(":")
            if name.strip().lower() == "content-length":
                length = int(value)
            if line in (b"\r\n", b"\n") and length is not None:
                break
        else:
            raise ValueError("a stream of pictures has parts with Content-Length; found none in %d lines"
                             % _HEADER_LINES)
        if not 0 < length <= _PICTURE_BYTES:
            raise ValueError("a picture has 1 to %d bytes; found %d" % (_PICTURE_BYTES, length))
        content = stream.read(length)
        if len(content) < length:
            return
        yield content


class CameraStream:
    """topic: of a camera's images; address: http:// of web_video_server; (height, width) of the pictures."""

    def __init__(self, address: str, topic: str, height: int, width: int, timeout_s: float = 5.0):
        query = urllib.parse.urlencode({"topic": topic, "width": width, "height": height, "type": "mjpeg"})
        self.url = "%s/stream?%s" % (address.rstrip("/"), query)
        self._shape, self._timeout_s = (height, width, 3), timeout_s
        self._came, self._ended = threading.Condition(), False
        self._newest: tuple[bytes, float] | None = None
        self._error = "no picture yet"
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ended:
            try:
                with urllib.request.urlopen(self.url, timeout=self._timeout_s) as stream:
                    for content in parts(stream):
                        with self._came:
                            self._newest = content, time.monotonic()
                            self._came.notify_all()
                        if self._ended:
                            return
                raise OSError("the server has ended the stream")
            except Exception as error:  # whatever the server sends, the next try may be better
                with self._came:
                    self._error = str(error) or type(error).__name__
                    self._came.wait(0.5)

    def picture(self, age_s: float, wait_s: float = 0.0) -> np.ndarray:
        """(height, width, 3) uint8, RGB, at most `age_s` old; waits up to `wait_s` for it. Raises ConnectionError."""
        end = time.monotonic() + wait_s
        with self._came:
            while self._newest is None or time.monotonic() - self._newest[1] > age_s:
                left = end - time.monotonic()
                if left <= 0.0:
                    raise ConnectionError("no picture younger than %g s from %s: %s" % (age_s, self.url, self._error))
                self._came.wait(left)
            content = self._newest[0]
        try:
            pixels = np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            raise ConnectionError("%s sends what is no picture: %s" % (self.url, error)) from error
        if pixels.shape != self._shape:
            raise ConnectionError("%s sends pictures of %s; %s were asked for" % (self.url, pixels.shape, self._shape))
        return pixels

    def close(self) -> None:
        """End it; the thread ends with the next picture or time-out."""
        self._ended = True
