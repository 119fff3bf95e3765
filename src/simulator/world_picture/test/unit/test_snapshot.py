# SPDX-License-Identifier: BSD-3-Clause
"""The snapshot: a reader gets a whole state or none."""
import errno
import fcntl
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from world_picture import snapshot
from world_picture.shared_picture import PictureReader, PictureWriter
from world_picture.snapshot import SnapshotError, SnapshotReader, SnapshotWriter

NO_ROOM = os.strerror(errno.ENOSPC)  # in the user's language


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
    assert read.values.tolist() == [5.0, 0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 4.0] and read.paused is False
    writer.write(5, 0.01, [[1.0]], paused=True)
    assert reader.read().paused is True


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
from world_picture.snapshot import SnapshotWriter
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
        # It dies without cleaning up; the next simulator cleans up.
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
    """Another simulator cleans up between the making of the folder and of its file, or between the file and its
    lock."""
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


def left_over(parent, name="1-abc"):
    """A folder as a dead simulator leaves it behind."""
    folder = parent / ("%s%d-%s" % (snapshot._PREFIX, os.getuid(), name))
    folder.mkdir(0o700)
    (folder / "state").write_bytes(b"x")
    (folder / "scene.json").write_text("{}", encoding="ascii")
    return folder


def test_a_link_that_bears_the_name_of_a_left_over_folder_is_not_followed(tmp_path):
    shared, elsewhere = tmp_path / "shared", tmp_path / "elsewhere"
    shared.mkdir()
    elsewhere.mkdir()
    precious = left_over(elsewhere)
    link = shared / precious.name
    link.symlink_to(precious)
    assert snapshot.remove_stale(shared) == []
    assert sorted(path.name for path in precious.iterdir()) == ["scene.json", "state"]
    assert link.is_symlink()


def test_a_link_in_the_place_of_the_state_is_not_opened(tmp_path):
    folder = left_over(tmp_path)
    (folder / "state").unlink()
    os.mkfifo(tmp_path / "fifo")
    for target in (tmp_path / "fifo", "/dev/zero"):
        (folder / "state").symlink_to(target)
        assert snapshot.remove_stale(tmp_path) == []
        with pytest.raises(SnapshotError):
            SnapshotReader(folder)
        (folder / "state").unlink()
    os.mkfifo(folder / "state")
    assert snapshot.remove_stale(tmp_path) == []
    with pytest.raises(SnapshotError, match="plain file"):
        SnapshotReader(folder)


@pytest.mark.parametrize("whose", ["folder", "state"])
def test_what_belongs_to_somebody_else_is_neither_removed_nor_opened(tmp_path, monkeypatch, whose):
    folder = left_over(tmp_path)
    theirs = (folder if whose == "folder" else folder / "state").stat().st_ino
    fstat = os.fstat

    def foreign(descriptor):
        status = fstat(descriptor)
        if status.st_ino != theirs:
            return status
        return os.stat_result([*status[:4], os.getuid() + 1, *status[5:10]])

    monkeypatch.setattr(os, "fstat", foreign)
    assert snapshot.remove_stale(tmp_path) == []
    with pytest.raises(SnapshotError, match="belongs to user %d" % (os.getuid() + 1)):
        SnapshotReader(folder)
    monkeypatch.undo()
    assert (folder / "state").exists()
    assert snapshot.remove_stale(tmp_path) == [folder]
    assert os.listdir(tmp_path) == []


def test_a_state_that_is_too_short_is_none(tmp_path):
    with pytest.raises(SnapshotError, match="not a snapshot of this version"):
        SnapshotReader(left_over(tmp_path))


def no_space(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_without_room_there_is_no_snapshot_and_nothing_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "posix_fallocate", no_space)
    with pytest.raises(SnapshotError, match=NO_ROOM + ".*stand still"):
        SnapshotWriter(tmp_path)
    assert os.listdir(tmp_path) == []


def test_a_scene_without_room_leaves_the_old_one_and_the_next_is_seen(writer, monkeypatch):
    writer.write_scene([{"name": "old", "joints": []}])
    reader = SnapshotReader(writer.folder)
    with monkeypatch.context() as full:
        full.setattr(Path, "write_text", no_space)
        with pytest.raises(SnapshotError, match="scene.json: " + NO_ROOM):
            writer.write_scene([{"name": "new", "joints": []}])
    assert [body["name"] for body in reader.scene().bodies] == ["old"]
    # A scene that could not be written still counts as a revision, so that readers do not match its states with the old
    # scene.
    writer.write(1, 0.002, [[0.0] * 7])
    assert reader.read().revision != reader.scene().revision
    writer.write_scene([{"name": "new", "joints": []}])
    assert [body["name"] for body in reader.scene().bodies] == ["new"]


def test_a_picture_without_room_is_an_error_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "posix_fallocate", no_space)
    with pytest.raises(SnapshotError, match=NO_ROOM):
        PictureWriter(tmp_path / "screen1", 4, 3)
    assert os.listdir(tmp_path) == []


def test_a_picture_is_written_through_no_link(tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("mine", encoding="ascii")
    (tmp_path / "screen1").symlink_to(precious)
    with pytest.raises(SnapshotError):
        PictureWriter(tmp_path / "screen1", 4, 3)
    with pytest.raises(SnapshotError):
        PictureReader(tmp_path / "screen1")
    assert precious.read_text(encoding="ascii") == "mine"


def test_a_viewer_knows_of_another_picture_before_it_reads_it(tmp_path):
    writer = PictureWriter(tmp_path / "screen1", 4, 2)
    reader = PictureReader(tmp_path / "screen1")
    reader.read()
    assert reader.version == 0 and reader.read() is None
    writer.show(np.full((2, 4, 3), 9, dtype=np.uint8))
    assert reader.version == 1
    assert reader.read().max() == 9
    assert reader.version == 1


def test_a_picture_that_is_shorter_than_it_says_is_refused(tmp_path):
    picture = PictureWriter(tmp_path / "screen1", 4, 3)
    picture.show(np.zeros((3, 4, 3), np.uint8))
    os.truncate(tmp_path / "screen1", 30)
    with pytest.raises(SnapshotError, match="shorter"):
        PictureReader(tmp_path / "screen1")


@pytest.mark.skipif(os.getuid() != 0, reason="mounts a separate file system")
def test_a_full_file_system_ends_no_process(tmp_path):
    """As root: a real tmpfs with 64 kB left, where a write to unreserved memory would kill the process (SIGBUS)."""
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(tmp_path)], check=False).returncode:
        pytest.skip("may not mount here")
    try:
        with pytest.raises(SnapshotError, match=NO_ROOM):
            SnapshotWriter(tmp_path)
        assert os.listdir(tmp_path) == []
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)
