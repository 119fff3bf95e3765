# SPDX-License-Identifier: BSD-3-Clause
import errno
import os
import struct
import threading
import zlib

import pytest

from command_line.user_files import check_file, check_picture, read_file, read_text


@pytest.mark.parametrize("make, message", [
    (lambda path: os.mkfifo(path), "a named pipe, not a file"),
    (lambda path: path.symlink_to("/dev/zero"), "a device, not a file"),
    (lambda path: path.mkdir(), "Is a directory|a folder"),
    (lambda path: path.write_bytes(b""), "it is empty"),
    (lambda path: path.write_bytes(b"a" * 11), "11 bytes, expected at most 10"),
    (lambda path: None, os.strerror(errno.ENOENT)),
])
def test_only_files_are_read_and_no_more_of_them_than_expected(tmp_path, make, message):
    make(tmp_path / "thing")
    for read in (read_file, read_text, check_file):
        with pytest.raises(OSError, match=message):
            read(tmp_path / "thing", 10)


def test_a_file_is_read(tmp_path):
    (tmp_path / "thing").write_bytes("\u00e4".encode() * 5)
    assert read_file(tmp_path / "thing", 10) == "\u00e4".encode() * 5
    assert read_text(tmp_path / "thing", 10) == "\u00e4" * 5
    check_file(tmp_path / "thing", 10)
    (tmp_path / "thing").write_bytes(b"\xff")
    with pytest.raises(ValueError, match="utf-8"):
        read_text(tmp_path / "thing", 10)


def test_a_link_is_followed_unless_told_otherwise(tmp_path):
    (tmp_path / "thing").write_bytes(b"a")
    (tmp_path / "link").symlink_to("thing")
    assert read_file(tmp_path / "link", 10) == b"a"
    with pytest.raises(OSError):
        read_file(tmp_path / "link", 10, follow_links=False)


def written(path, content):
    """Write into a pipe from another thread, which waits for its reader."""
    thread = threading.Thread(target=path.write_bytes, args=(content,), daemon=True)
    thread.start()
    return thread


def test_a_pipe_that_ends_is_read_where_a_command_may_name_one(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    content = b"a" * 300_000  # more than a pipe holds
    thread = written(tmp_path / "pipe", content)
    assert read_file(tmp_path / "pipe", 1_000_000, pipe_wait_s=60.0) == content
    thread.join(60.0)


def test_a_pipe_of_a_shell_is_read(tmp_path):
    """As in `spawn_model -file <(xacro robot.xacro)`, also where its program has ended before."""
    to_read, to_write = os.pipe()
    try:
        os.write(to_write, b"abc")
        os.close(to_write)
        assert read_text("/dev/fd/%d" % to_read, 10, pipe_wait_s=60.0) == "abc"
    finally:
        os.close(to_read)


def test_a_pipe_without_an_end_is_given_up(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match=r"not ended after 0\.05 s"):
        read_file(tmp_path / "pipe", 10, pipe_wait_s=0.05)
    with open(tmp_path / "pipe", "r+b", buffering=0) as end:
        end.write(b"a" * 10)
        with pytest.raises(OSError, match=r"not ended after 0\.05 s"):
            read_file(tmp_path / "pipe", 10, pipe_wait_s=0.05)
        end.write(b"a" * 11)
        with pytest.raises(OSError, match="expected at most 10"):
            read_file(tmp_path / "pipe", 10, pipe_wait_s=60.0)


def png(width, height):
    """A grey PNG of that size, all black, which is a thousandth of its pixels."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) + chunk(
        b"IDAT", zlib.compress(b"\0" * (width + 1) * min(height, 10))) + chunk(b"IEND", b"")


def test_a_picture_is_checked_before_it_is_unpacked():
    check_picture(png(10, 10), 100)
    with pytest.raises(OSError, match="11 x 10 pixels, expected at most 100"):
        check_picture(png(11, 10), 100)
    with pytest.raises(OSError, match="at most 100"):
        check_picture(png(100_000, 100_000), 100)
    with pytest.raises(OSError, match="no picture"):
        check_picture(b"anything else", 100)
