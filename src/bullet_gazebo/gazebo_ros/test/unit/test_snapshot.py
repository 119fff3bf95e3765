# SPDX-License-Identifier: BSD-3-Clause
"""The snapshot: what one process writes, another reads whole or not at all."""
import fcntl
import os
import subprocess
import sys
import tempfile
import time

import numpy as np
import pytest

from gazebo_ros import snapshot
from gazebo_ros.snapshot import SnapshotError, SnapshotReader, SnapshotWriter


@pytest.fixture
def writer(tmp_path):
    writer = SnapshotWriter(tmp_path)
    yield writer
    writer.close()


def test_nothing_to_read_before_the_first_write(writer):
    assert SnapshotReader(writer.folder).read() is None


def test_a_reader_gets_what_was_written_last(writer):
    reader = SnapshotReader(writer.folder)
    for tick in range(1, 6):
        writer.write(tick, tick * 0.002, [(tick, 0.0, 1.0), np.arange(tick, dtype=float)])
    read = reader.read()
    assert (read.tick, read.time_s, read.revision) == (5, 0.01, writer.revision)
    assert read.values.tolist() == [5.0, 0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 4.0]


def test_what_was_read_does_not_change_afterwards(writer):
    writer.write(1, 0.002, [[1.0]])
    read = SnapshotReader(writer.folder).read()
    for tick in (2, 3):
        writer.write(tick, 0.0, [[9.0]])
    assert read.values.tolist() == [1.0]


def test_a_new_scene_raises_the_revision(writer):
    reader = SnapshotReader(writer.folder)
    writer.write_scene([{"name": "robot", "joints": ["a"], "urdf": "<robot/>"}], {"shadows": False})
    scene = reader.scene()
    assert scene.revision == writer.revision and scene.bodies[0]["name"] == "robot"
    assert scene.light == {"shadows": False}
    writer.write(1, 0.0, [[0.0] * 8])
    assert reader.read().revision == scene.revision


def test_too_many_values_are_refused(writer):
    with pytest.raises(ValueError, match="capacity"):
        writer.write(1, 0.0, [np.zeros(snapshot.CAPACITY), [0.0]])
    assert SnapshotReader(writer.folder).read() is None


def test_closing_removes_the_folder_and_readers_notice(writer):
    reader = SnapshotReader(writer.folder)
    writer.write(1, 0.0, [[1.0]])
    assert reader.is_alive
    writer.close()
    assert not writer.folder.exists() and not reader.is_alive
    assert reader.read().values.tolist() == [1.0]


def test_no_folder_is_an_error_that_names_it(tmp_path):
    with pytest.raises(SnapshotError, match="nowhere"):
        SnapshotReader(tmp_path / "nowhere")


def test_a_folder_is_private(writer):
    assert (writer.folder.stat().st_mode & 0o077) == 0


WRITE_FOR_EVER = """
import sys
from gazebo_ros.snapshot import SnapshotWriter
writer = SnapshotWriter(sys.argv[1])
print(writer.folder, flush=True)
tick = 0
while True:
    tick += 1
    writer.write(tick, 0.0, [[float(tick)] * (1 + tick % 700)])
"""


def test_a_reader_in_another_process_never_sees_half_a_state(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", WRITE_FOR_EVER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    try:
        reader = SnapshotReader(process.stdout.readline().strip())
        seen = set()
        deadline = time.monotonic() + 60.0
        while len(seen) < 1000:
            assert time.monotonic() < deadline, "only %d states in a minute" % len(seen)
            read = reader.read()
            if read is not None:
                assert len(read.values) == 1 + read.tick % 700
                assert (read.values == read.tick).all()
                seen.add(read.tick)
        # It dies without cleaning up: the next simulator does.
        process.kill()
        process.wait()
        assert len(snapshot.remove_stale(tmp_path)) == 1
        assert os.listdir(tmp_path) == []
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_the_folder_of_a_living_simulator_stays(writer, tmp_path):
    assert snapshot.remove_stale(tmp_path) == []
    assert writer.folder.exists()


@pytest.mark.parametrize("module, name", [(tempfile, "mkdtemp"), (fcntl, "flock")])
def test_a_folder_that_another_simulator_takes_for_a_left_over_one_is_made_again(tmp_path, monkeypatch, module, name):
    """Its clearing up falls between the folder and its file, or between the file and its lock."""
    made, called = [], getattr(module, name)

    def overtaken(*arguments, **options):
        if made:
            return called(*arguments, **options)
        made.append(True)
        result = called(*arguments, **options) if module is tempfile else None
        snapshot.remove_stale(tmp_path)
        assert os.listdir(tmp_path) == []
        return called(*arguments, **options) if result is None else result

    monkeypatch.setattr(module, name, overtaken)
    writer = SnapshotWriter(tmp_path)
    writer.write(1, 0.002, [[1.0]])
    assert snapshot.remove_stale(tmp_path) == []
    assert SnapshotReader(writer.folder).read().values.tolist() == [1.0]
    writer.close()
    assert os.listdir(tmp_path) == []


def test_a_reader_can_tell_one_time_from_the_same_after_a_reset(writer):
    reader = SnapshotReader(writer.folder)
    writer.write(5, 0.01, [[1.0]])
    before = reader.read()
    writer.resets += 1
    writer.write(5, 0.01, [[1.0]])
    after = reader.read()
    assert (before.tick, before.time_s) == (after.tick, after.time_s)
    assert (before.resets, after.resets) == (0, 1)
