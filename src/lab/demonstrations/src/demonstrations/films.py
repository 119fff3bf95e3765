# SPDX-License-Identifier: BSD-3-Clause
"""Films of a camera in H.264 with every frame exactly on the grid of the rate, and their frames back. By PyAV."""
from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import numpy as np

from .frames import DemonstrationError
from .needed import need

#: Every second frame can be jumped to: sets are read frame by frame in any order. A higher crf is smaller and worse.
_GROUP, _CRF, _PRESET = 2, 23, "veryfast"
CODEC, PIXELS = "h264", "yuv420p"


class Film:
    """A film that is written frame by frame. path: *.mp4; size: (height, width), even. Raises OSError."""

    def __init__(self, path: Path, rate_hz: int, size: tuple[int, int]):
        av = need("av")
        self.path, self._av, self._count = path, av, 0
        self._container = av.open(str(path), "w", format="mp4")
        options = {"g": str(_GROUP), "crf": str(_CRF), "preset": _PRESET, "threads": "1", "bf": "0"}
        self._stream = self._container.add_stream("libx264", rate=rate_hz, options=options)
        self._stream.height, self._stream.width, self._stream.pix_fmt = *size, PIXELS
        self._stream.codec_context.time_base = Fraction(1, rate_hz)

    def add(self, pixels: np.ndarray) -> None:
        """Append a picture (height, width, 3) uint8. Raises ValueError after `close`."""
        if self._container is None:
            raise ValueError("%s is finished; it takes no more pictures" % self.path)
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
        frame.pts, frame.time_base = self._count, self._stream.codec_context.time_base
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Finish the file. A second call does nothing."""
        container, self._container = self._container, None
        if container is not None:
            with container:
                container.mux(self._stream.encode(None))

    def drop(self) -> None:
        """Give the file up."""
        with suppress(OSError):
            self.close()
        self.path.unlink(missing_ok=True)


def frames_of(path: Path) -> Iterator[np.ndarray]:
    """The pictures of a film, (height, width, 3) uint8, in order. Raises DemonstrationError for what is no film."""
    av = need("av")
    try:
        with av.open(str(path)) as container:
            for frame in container.decode(video=0):
                yield frame.to_ndarray(format="rgb24")
    except (OSError, ValueError, IndexError) as error:
        raise DemonstrationError("%s is no readable film: %s" % (path, error)) from error


def frame_count(path: Path) -> int:
    """How many frames of a film can be read; 0 of a file that is none."""
    count = 0
    with suppress(DemonstrationError):
        for _ in frames_of(path):
            count += 1
    return count
