# SPDX-License-Identifier: BSD-3-Clause
"""The words of `./baxter.sh labs`."""
import errno
import os
import re
import signal
import socket
import subprocess
from types import SimpleNamespace

import pytest

from lab_class import command
from lab_class.disk import remove
from lab_class.factors import factor_of
from lab_class.store import ClassOptions, ClassRecord, Store, StoreError, default_folder
from lab_class.supervisor import Supervisor
from rf_checks import roster
from rf_checks.roster import Student


def test_a_launch_file_of_this_folder_is_found_from_another(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.launch").write_text("<launch/>", encoding="utf-8")
    assert command._launch("mine.launch pose:=tucked") == (str(tmp_path.resolve() / "mine.launch"), "pose:=tucked")
    assert command._launch("baxter_gazebo baxter_world.launch") == ("baxter_gazebo", "baxter_world.launch")


def test_ctrl_c_before_there_are_addresses_ends_the_class(tmp_path, monkeypatch):
    started = []

    def start(*_, **__):
        started.append(subprocess.Popen(["sleep", "60"]))
        return started[0]

    def ctrl_c(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "fetched", lambda page: tmp_path / "a" / "b")
    monkeypatch.setattr(command, "subprocess", SimpleNamespace(Popen=start, DEVNULL=None, STDOUT=None))
    monkeypatch.setattr(command, "_await_door", ctrl_c)
    assert command.main(["--folder", str(tmp_path / "class"), "up", "1", "--trusted"]) == 130
    assert started[0].poll() == -signal.SIGTERM


@pytest.mark.parametrize("words", [["--folder", "CLASS", "list"], ["list", "--folder", "CLASS"]])
def test_commands_that_are_named_have_the_folder_of_the_class(tmp_path, capsys, words):
    folder = tmp_path / "a class"
    assert command.main([word.replace("CLASS", str(folder)) for word in words]) == 1
    assert "./baxter.sh labs --folder '%s' up N" % folder in capsys.readouterr().err
    assert Store(default_folder()).command("down") == "./baxter.sh labs down"


def test_labs_that_have_started_and_what_wakes_them(monkeypatch, capsys):
    looks = [[("anna", "starting", ""), ("ben", "waiting", "")], [("anna", "paused", ""), ("ben", "failed", "no disk")]]

    def call(*_):
        return {"labs": [{"name": name, "state": state, "reason": reason, "is_starting": state == "starting"}
                         for name, state, reason in looks.pop(0)]}

    monkeypatch.setattr(command, "control", SimpleNamespace(call=call))
    monkeypatch.setattr(command, "_LOOK_S", 0.0)
    assert command._await_labs(None) == 1
    assert capsys.readouterr().out.splitlines() == [
        "anna is paused", "ben is failed: no disk", "A paused lab goes on as soon as its page is opened."]


def test_a_port_that_is_taken_is_named():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        supervisor = SimpleNamespace(_record=SimpleNamespace(options=ClassOptions(port=port)))
        with pytest.raises(StoreError, match=re.escape(
            "port %d cannot be opened (%s); --port" % (port, os.strerror(errno.EADDRINUSE)))):
            Supervisor._open(supervisor)


def test_a_roster_of_another_encoding_says_where_and_what_to_do(tmp_path, capsys):
    (tmp_path / "roster.csv").write_bytes("name\nAnna\nJürgen\n".encode("latin-1"))
    assert command.main(["--folder", str(tmp_path / "class"), "up", str(tmp_path / "roster.csv")]) == 2
    assert 'roster.csv is not UTF-8 (line 3); in a spreadsheet, save it as "CSV UTF-8"' in capsys.readouterr().err


def test_addresses_are_shown_again_while_the_class_runs(tmp_path, monkeypatch, capsys):
    store = Store(tmp_path / "class")
    store.make()
    record = ClassRecord.made(ClassOptions(), [Student("anna", "Anna Müller")])
    store.write(record)
    store.write_running({"port": 8123})
    monkeypatch.setattr(command.control, "call", lambda *_: {"labs": []})
    assert command.main(["--folder", str(store.folder), "list", "--addresses"]) == 0
    said = capsys.readouterr().out
    assert "http://localhost:8123/instructor/?token=" + record.instructor in said
    assert "Anna Müller" in said and "http://localhost:8123/anna/?token=" + record.tokens["anna"].act in said


def test_addresses_are_a_table_that_is_a_roster_again(tmp_path, monkeypatch, capsys):
    store = Store(tmp_path / "class")
    store.make()
    students = [Student("am1", "Müller, Anna"), Student("ben", "Ben")]
    record = ClassRecord.made(ClassOptions(), students)
    store.write(record)
    store.write_running({"port": 8123})
    monkeypatch.setattr(command.control, "call", lambda *_: {"labs": []})
    assert command.main(["--folder", str(store.folder), "list", "--csv"]) == 0
    said = capsys.readouterr().out
    assert said.splitlines()[2] == "Ben,ben,http://localhost:8123/ben/?token=" + record.tokens["ben"].act
    assert roster.read(said) == students


@pytest.mark.parametrize("option", ["--addresses", "--csv"])
def test_addresses_of_a_class_whose_record_is_gone(tmp_path, monkeypatch, capsys, option):
    monkeypatch.setattr(command.control, "call", lambda *arguments: {"labs": []})
    assert command.main(["--folder", str(tmp_path), "list", option]) == 1
    assert "no class in %s" % tmp_path in capsys.readouterr().err


def test_logs_of_a_lab_that_the_class_has_not_names_those_that_it_has(tmp_path, capsys):
    store = Store(tmp_path / "class")
    store.make()
    store.write(ClassRecord.made(ClassOptions(), [Student("anna", "Anna"), Student("ben", "Ben")]))
    for name, text in (("bem", "there is no lab bem; there are: anna, ben"), ("ben", "a class that runs has logs")):
        assert command.main(["--folder", str(store.folder), "logs", name]) == 1
        assert text in capsys.readouterr().err


@pytest.fixture
def after_power_cut(tmp_path):
    """The folder of a class as a host that lost power may have left it."""
    store = Store(tmp_path / "class")
    store.make()
    store.write(ClassRecord.made(ClassOptions(), [Student("anna", "Anna")]))
    for name in ("home", "caches/cache-0"):
        (store.lab("anna") / name).mkdir(parents=True, exist_ok=True)
    (store.lab("anna") / "home/work.py").write_text("print()")
    (store.lab("anna") / "output.txt").write_text("")
    (store.folder / "supervisor.log").write_text("")
    return store


@pytest.mark.parametrize("text", ['{"pid": 1, "cont', "", None])
def test_after_a_power_cut_the_end_leaves_students_files_alone(after_power_cut, text, capsys):
    store = after_power_cut
    if text is not None:
        (store.folder / "running.json").write_text(text)
    assert command.main(["--folder", str(store.folder), "list"]) == 1
    assert "no class runs in" in capsys.readouterr().err
    assert command.main(["--folder", str(store.folder), "down"]) == 0
    assert sorted(path.name for path in store.folder.iterdir()) == ["class.json", "labs"]
    assert [path.name for path in store.lab("anna").iterdir()] == ["home"]
    assert (store.lab("anna") / "home/work.py").read_text() == "print()"


def test_only_a_folder_that_is_a_supervisors_and_this_users_is_removed(after_power_cut, tmp_path, monkeypatch):
    store = after_power_cut
    for name, owner, stays in (("documents", os.geteuid(), True), ("lab-class-abc", os.geteuid() + 1, True),
                               ("lab-class-abc", os.geteuid(), False)):
        (tmp_path / name).mkdir(exist_ok=True)
        # The number of the process is another program's by now.
        store.write_running({"pid": os.getpid(), "control": str(tmp_path / name / "control"),
                             "runtime": str(tmp_path / name), "groups": [str(tmp_path / "gone")]})
        with monkeypatch.context() as patch:
            patch.setattr(os, "geteuid", lambda owner=owner: owner)
            assert command.main(["--folder", str(store.folder), "down"]) == 0
        assert (tmp_path / name).exists() is stays


def test_what_a_student_has_made_deep_is_deleted_with_the_class(after_power_cut, request):
    request.addfinalizer(lambda: remove(after_power_cut.folder))
    fd = os.open(after_power_cut.lab("anna") / "home", os.O_RDONLY)
    for _ in range(2000):
        os.mkdir("d", dir_fd=fd)
        below = os.open("d", os.O_RDONLY, dir_fd=fd)
        os.close(fd)
        fd = below
    os.close(fd)
    assert command.main(["--folder", str(after_power_cut.folder), "down", "--delete"]) == 0
    assert not after_power_cut.folder.exists()


def test_new_addresses_while_no_class_runs(tmp_path, capsys):
    store = Store(tmp_path / "class")
    store.make()
    before = ClassRecord.made(ClassOptions(), [Student("anna", "Anna"), Student("ben", "Ben")])
    store.write(before)
    assert command.main(["--folder", str(store.folder), "renew", "anna", "instructor"]) == 0
    after = store.read()
    said = capsys.readouterr().out
    assert after.tokens["anna"].act in said and after.instructor in said
    assert before.tokens["anna"] != after.tokens["anna"] and before.instructor != after.instructor
    assert after.tokens["ben"] == before.tokens["ben"]
    assert command.main(["--folder", str(store.folder), "renew", "anna", "bem"]) == 1
    assert "there is no lab bem; there are: anna, ben" in capsys.readouterr().err and store.read() == after


def test_students_who_are_not_in_the_class_any_more_are_named(capsys):
    earlier = ClassRecord.made(ClassOptions(), [Student("anna", "Anna"), Student("ben", "Ben")])
    command._say_who_has_left(earlier, ClassRecord.made(ClassOptions(), [Student("anna", "Anna")], earlier))
    assert capsys.readouterr().out == ("Ben (ben) is not in the class any more, and the address opens nothing; the "
                                       "files stay in labs/ben/home.\n")
    command._say_who_has_left(None, earlier)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("kind", ["device", "empty"])
def test_a_roster_that_is_no_file_is_not_waited_for(tmp_path, capsys, kind):
    (tmp_path / "empty").touch()
    roster_file = {"device": "/dev/zero", "empty": str(tmp_path / "empty")}[kind]
    assert command.main(["--folder", str(tmp_path / "class"), "up", roster_file]) == 2
    said = capsys.readouterr().err
    assert roster_file in said and kind in said


@pytest.mark.parametrize("factor", ["1e999", "NaN", "1" + "0" * 400, '"x"', "[1]"])
def test_a_factor_beyond_all_bounds_is_none(factor):
    assert factor_of('{"msg": {"real_time_factor": %s}}' % factor) is None
