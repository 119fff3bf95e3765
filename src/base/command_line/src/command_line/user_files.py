# SPDX-License-Identifier: BSD-3-Clause
"""Read files that a user or a description names, without waiting and up to a size. Free of ROS.

Reading a named pipe may wait for ever, and a device may never end. So everything that opens a roster, recording, model,
world or submission does so here: only regular files, and no more of them than the reader can use. A program with a
command line may take a pipe too, as in `spawn_model -file <(xacro robot.xacro)`; it then says for how long.
"""
from __future__ import annotations

import errno
import io
import os
import select
import stat
import time

#: How long a command waits for the end of a pipe that its user names [s].
PIPE_WAIT_S = 60.0
_CHUNK = 1 << 16


def read_file(
    path: str | os.PathLike, most_bytes: int, *, pipe_wait_s: float = 0.0, follow_links: bool = True
) -> bytes:
    """Return the content of a regular file; with ``pipe_wait_s`` > 0, also of a pipe that ends within that time.

    Raises OSError for anything else, for an empty file and for one of more than ``most_bytes``; its ``strerror`` says
    what was found and what would be right. ``follow_links`` = False refuses a path that is a symbolic link.
    """
    # Neither opening nor reading a pipe without a writer waits.
    flags = os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY | (0 if follow_links else os.O_NOFOLLOW)
    if os.path.isdir(path):
        raise OSError(errno.EISDIR, "it is a folder, not a file", str(path))
    with open(path, "rb", opener=lambda name, mode: os.open(name, mode | flags)) as file:
        status = os.fstat(file.fileno())
        if stat.S_ISFIFO(status.st_mode) and pipe_wait_s > 0.0:
            return _read_pipe(file.fileno(), path, most_bytes, pipe_wait_s)
        _check(status, path, most_bytes)
        content = file.read(most_bytes + 1)
        if len(content) > most_bytes:  # it has grown since
            raise _too_large(len(content), path, most_bytes)
        return content


def read_text(path: str | os.PathLike, most_bytes: int, *, pipe_wait_s: float = 0.0) -> str:
    """As :func:`read_file`, decoded. Raises OSError, and UnicodeDecodeError, a ValueError, for what is not UTF-8."""
    return read_file(path, most_bytes, pipe_wait_s=pipe_wait_s).decode("utf-8")


def check_file(path: str | os.PathLike, most_bytes: int) -> None:
    """For a library that opens the file itself: raises OSError where `read_file` would, but reads nothing."""
    _check(os.stat(path), path, most_bytes)


def check_picture(content: bytes, most_pixels: int) -> None:
    """Raise OSError unless ``content`` is a picture of at most ``most_pixels``, by its header alone: some kilobytes may
    unpack to gigabytes in the library that reads it next."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(content)) as picture:
            width, height = picture.size
    except (UnidentifiedImageError, SyntaxError, ValueError):
        raise OSError(errno.EINVAL, "it is no picture in a format that is read") from None
    except Image.DecompressionBombError:
        raise OSError(errno.EFBIG, "it has more pixels than expected, at most %d" % most_pixels) from None
    if width * height > most_pixels:
        raise OSError(errno.EFBIG, "it has %d x %d pixels, expected at most %d" % (width, height, most_pixels))


def kind_of(mode: int) -> str:
    """Return in words what a path with the ``st_mode`` ``mode`` is, where it is not a regular file."""
    kinds = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a named pipe"), (stat.S_ISSOCK, "a socket"),
             (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"))
    return next((words for is_kind, words in kinds if is_kind(mode)), "something else")


def _check(status: os.stat_result, path: str | os.PathLike, most_bytes: int) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is %s, not a file" % kind_of(status.st_mode), str(path))
    # The kernel's own files claim to be empty, and reading some of them waits.
    if status.st_size == 0:
        raise OSError(errno.EINVAL, "it is empty", str(path))
    if status.st_size > most_bytes:
        raise _too_large(status.st_size, path, most_bytes)


def _too_large(size: int, path: str | os.PathLike, most_bytes: int) -> OSError:
    return OSError(errno.EFBIG, "it has %d bytes, expected at most %d" % (size, most_bytes), str(path))


def _read_pipe(descriptor: int, path: str | os.PathLike, most_bytes: int, wait_s: float) -> bytes:
    deadline = time.monotonic() + wait_s
    poller = select.poll()
    poller.register(descriptor, select.POLLIN)
    content = b""
    while len(content) <= most_bytes:
        left_s = deadline - time.monotonic()
        if left_s <= 0.0:
            raise OSError(errno.ETIMEDOUT, "it is a pipe that has not ended after %g s" % wait_s, str(path))
        if poller.poll(1000.0 * left_s):
            try:
                part = os.read(descriptor, _CHUNK)
            except BlockingIOError:  # another reader was faster
                continue
            if not part:
                return content
            content += part
    raise _too_large(len(content), path, most_bytes)
