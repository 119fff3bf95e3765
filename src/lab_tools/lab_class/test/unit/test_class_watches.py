# SPDX-License-Identifier: BSD-3-Clause
"""What the supervisor measures in folders that students write to, and that its loops outlive any error."""
import asyncio
import os

import pytest

from lab_class.lab_process import disk_bytes, remove
from lab_class.supervisor import Supervisor, _end_of

DEPTH = 3000


@pytest.fixture
def deep_folder(tmp_path):
    """Deeper than Python's recursion and the longest path; a file of 1 MB is at the bottom."""
    top = tmp_path / "home"
    top.mkdir()
    here = os.open(top, os.O_RDONLY)
    for _ in range(DEPTH):
        os.mkdir("d", dir_fd=here)
        below = os.open("d", os.O_RDONLY, dir_fd=here)
        os.close(here)
        here = below
    with open(os.open("large", os.O_WRONLY | os.O_CREAT, dir_fd=here), "wb") as stream:
        stream.write(b"x" * 2**20)
    os.close(here)
    yield top
    remove(top)


def test_a_file_in_a_very_deep_folder_counts_and_can_be_removed(deep_folder):
    assert disk_bytes(deep_folder) > 2**20
    remove(deep_folder)
    assert not deep_folder.exists()


def test_empty_files_count(tmp_path):
    before = disk_bytes(tmp_path)
    for number in range(1000):
        (tmp_path / str(number)).touch()
    assert disk_bytes(tmp_path) >= before + 256 * 1000


def test_files_behind_links_do_not_count(tmp_path):
    (tmp_path / "home").mkdir()
    (tmp_path / "large").write_bytes(b"x" * 2**20)
    (tmp_path / "home/link").symlink_to(tmp_path / "large")
    assert disk_bytes(tmp_path / "home") < 2**20


def test_a_folder_that_is_gone_is_an_error_that_names_it(tmp_path):
    with pytest.raises(OSError, match="gone"):
        disk_bytes(tmp_path / "gone")


def test_a_loop_outlives_an_error():
    calls = []

    async def watch():
        calls.append(None)
        if len(calls) == 1:
            raise RecursionError("a lab's folder")
        if len(calls) == 3:
            raise asyncio.CancelledError

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(Supervisor._every(0.0, watch))
    assert len(calls) == 3


def test_of_a_large_output_only_the_end_is_read(tmp_path):
    path = tmp_path / "output.txt"
    with open(path, "wb") as stream:
        stream.truncate(2**33)
        stream.seek(0, os.SEEK_END)
        stream.write(b"\nthe lab ended: roslaunch failed\n")
    assert _end_of(path).splitlines()[-1] == "the lab ended: roslaunch failed"
    path.write_bytes(b"short")
    assert _end_of(path) == "short"
