# SPDX-License-Identifier: BSD-3-Clause
"""The class on disk."""
import errno
import os

import pytest

from lab_class.labs import ClassError
from lab_class.store import ClassOptions, ClassRecord, Store, StoreError
from rf_checks import roster


@pytest.fixture
def store(tmp_path):
    made = Store(tmp_path / "class")
    made.make()
    return made


def test_a_class_comes_back_as_it_was(store):
    record = ClassRecord.made(ClassOptions(port=9000, idle_s=None), roster.numbered(2))
    store.write(record)
    assert store.read() == record
    assert (store.folder / "class.json").stat().st_mode & 0o077 == 0
    assert store.folder.stat().st_mode & 0o077 == 0


def test_students_that_stay_keep_their_addresses():
    first = ClassRecord.made(ClassOptions(), roster.numbered(2))
    second = ClassRecord.made(ClassOptions(), roster.numbered(3), first)
    assert second.instructor == first.instructor
    assert second.tokens["student-01"] == first.tokens["student-01"]
    tokens = [token for pair in second.tokens.values() for token in (pair.act, pair.view)] + [second.instructor]
    assert len(set(tokens)) == 7 and min(map(len, tokens)) > 20


def test_new_tokens_for_one_student_or_the_instructor():
    first = ClassRecord.made(ClassOptions(), roster.numbered(2))
    second = first.renewed("student-01")
    assert second.tokens["student-01"] != first.tokens["student-01"]
    assert (second.tokens["student-02"], second.instructor) == (first.tokens["student-02"], first.instructor)
    third = first.renewed("instructor")
    assert third.instructor != first.instructor and third.tokens == first.tokens
    with pytest.raises(ClassError, match="there is no lab anna; there are: student-01, student-02"):
        first.renewed("anna")


def test_no_class_and_broken_ones(store):
    assert store.read() is None
    for data in (b"", b"[]", b"{}", b'{"options": {"launch": 3}}', b'{"options": [], "students": [], "tokens": {}}',
                 b"\0" * 100, b"\xff\xfe\x80"):
        (store.folder / "class.json").write_bytes(data)
        with pytest.raises(StoreError, match="class.json is not the record of a class"):
            store.read()


def test_one_supervisor_at_a_time(store):
    with store.locked():
        with pytest.raises(StoreError, match="labs --folder .* down"), store.locked():
            pass


def test_the_end_of_a_run_leaves_the_students_files(store):
    work = store.lab("anna") / "home" / "work.py"
    work.write_text("print()")
    (store.lab("anna") / "output.txt").write_text("x")
    (store.lab("anna") / "caches").mkdir()
    store.write_running({"pid": 1})
    for name in ("class.json.new", "running.json.new"):
        (store.folder / name).write_text("{")
    store.remove_run()
    assert [path.name for path in store.folder.iterdir()] == ["labs"]
    assert [path.name for path in store.lab("anna").iterdir()] == ["home"] and work.exists()
    assert store.running() == {}


@pytest.mark.parametrize("data", [b"", b'{"pid": 1, "contr', b"[1]", b"null", b"\0" * 50, b"\xff\xfe"])
def test_a_host_that_lost_power_has_kept_any_part_of_a_supervisors_file(store, data):
    (store.folder / "running.json").write_bytes(data)
    assert store.running() == {}


def test_on_a_full_disk_the_class_stays_as_it_was(store, monkeypatch):
    record = ClassRecord.made(ClassOptions(), roster.numbered(1))
    store.write(record)

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StoreError, match="class.json cannot be written: " + os.strerror(errno.ENOSPC)):
        store.write(record.renewed("student-01"))
    assert store.read() == record and [path.name for path in store.folder.iterdir()] == ["class.json"]


def test_a_folder_that_cannot_be(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be the folder of the class"):
        Store(tmp_path / "file" / "class").make()
