# SPDX-License-Identifier: BSD-3-Clause
"""Submissions in the layouts of learning platforms, and those that nobody can read."""
import io
import os
import zipfile

import pytest

from rf_grading.submissions import BadFolder, read_class

NAMES = ("wave", "tf_listener")


def put(folder, files):
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


def zipped(files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def by_entry(folder, **options):
    return {one.entry: one for one in read_class(folder, NAMES, **options)[0]}


def test_a_folder_or_an_archive_or_files_for_each_student(tmp_path):
    put(tmp_path, {"Li Wei/wave.py": "1", "Li Wei/lib/b.py": "2", "öz.zip": zipped({"wave.py": "3"}),
                   "kim_wave.py": "4", "kim_tf_listener.py": "5", "lone.py": "6", "roster.csv": "-", ".git/x.py": "7",
                   "__MACOSX/a.py": "8"})
    found, left_out = read_class(tmp_path, NAMES)
    assert {one.entry: one.files for one in found} == {
        "Li Wei": {"wave.py": b"1", "lib/b.py": b"2"}, "öz": {"wave.py": b"3"},
        "kim": {"kim_wave.py": b"4", "kim_tf_listener.py": b"5"}, "lone": {"lone.py": b"6"}}
    assert left_out == ["roster.csv"]
    assert [one.problem for one in found] == [""] * 4


def test_moodles_folders_and_its_flat_form(tmp_path):
    put(tmp_path, {"Anna Groß_12_assignsubmission_file_/wave.py": "1", "Bo_13_assignsubmission_file_wave.py": "2",
                   "Bo_13_assignsubmission_file_help.py": "3",
                   "Cy_14_assignsubmission_file_work.zip": zipped({"w.py": "4"}),
                   "Di_15_assignsubmission_onlinetext_/onlinetext.html": "5"})
    found = by_entry(tmp_path)
    anna, bo = found["Anna Groß_12_assignsubmission_file_"], found["Bo_13_assignsubmission_file_"]
    assert (anna.student, anna.name, anna.files) == ("12", "Anna Groß", {"wave.py": b"1"})
    assert (bo.student, bo.name, bo.files) == ("13", "Bo", {"wave.py": b"2", "help.py": b"3"})
    assert found["Cy_14_assignsubmission_file_"].files == {"w.py": b"4"}
    assert found["Di_15_assignsubmission_onlinetext_"].problem == (
        "the submission holds no Python file, only onlinetext.html")


def test_pictures_in_notebooks_and_films_in_archives_are_no_hindrance(tmp_path):
    notebook, film = "{" + " " * (3 << 20), os.urandom(20 << 20)
    packed = zipped({"wave.ipynb": notebook, "film.mp4": film})
    put(tmp_path / "class", {"a/wave.ipynb": notebook, "b/w.zip": packed, "c.zip": packed})
    (tmp_path / "class.zip").write_bytes(zipped({"a/wave.ipynb": notebook, "b/w.zip": packed, "c.zip": packed}))
    for path in (tmp_path / "class", tmp_path / "class.zip"):
        assert {entry: (list(one.files), one.problem) for entry, one in by_entry(path).items()} == {
            "a": (["wave.ipynb"], ""), "b": (["w/wave.ipynb"], ""), "c": (["wave.ipynb"], "")}


def test_a_file_that_is_too_large_is_its_students_problem_alone(tmp_path):
    large = "#" * (2 << 20)
    put(tmp_path / "class", {"a/wave.py": large, "b/wave.py": "1"})
    (tmp_path / "class.zip").write_bytes(zipped({"a/wave.py": large, "b/wave.py": "1"}))
    for path in (tmp_path / "class", tmp_path / "class.zip"):
        found = by_entry(path)
        assert "1048576" in found["a"].problem and found["b"].files == {"wave.py": b"1"}


def test_many_archives_hold_no_more_than_one(tmp_path):
    put(tmp_path, {"a/%d.zip" % k: zipped({"%d.ipynb" % n: " " * (4 << 20) for n in range(3)}) for k in range(2)})
    assert by_entry(tmp_path)["a"].problem == "the submission holds more than 200 programs, or 16 MiB of them"


def test_gradescopes_export_has_names(tmp_path):
    put(tmp_path, {"submission_7/wave.py": "1", "submission_8/wave.py": "2", "submission_metadata.yml": (
        "submission_7:\n  :submitters:\n  - :name: Anna Groß\n    :sid: 'a12'\n    :email: anna@example.org\n"
        "submission_8: nothing\n")})
    found = by_entry(tmp_path)
    assert (found["submission_7"].name, found["submission_7"].student) == ("Anna Groß", "a12")
    assert found["submission_7"].email == "anna@example.org"
    assert found["submission_8"].student == "submission_8"
    put(tmp_path, {"submission_metadata.yml": "a: [\n"})
    assert by_entry(tmp_path)["submission_7"].student == "submission_7"


def test_nbgraders_folders_with_one_assignment_chosen(tmp_path):
    put(tmp_path, {"anna/ps1/wave.ipynb": "1", "anna/ps2/wave.py": "2", "anna/ps1/timestamp.txt": "t",
                   "bo/ps2/wave.py": "3"})
    found = by_entry(tmp_path, assignment="ps1")
    assert found["anna"].files == {"ps1/wave.ipynb": b"1"}
    assert found["bo"].problem == "the submission is empty"


def test_an_export_that_is_an_archive_itself(tmp_path):
    put(tmp_path, {"all.zip": zipped({"all/Anna_1_assignsubmission_file_/wave.py": "1",
                                      "all/Bo_2_assignsubmission_file_/w.zip": zipped({"wave.py": "2"}),
                                      "all/Cy_3_assignsubmission_file_/report.pdf": "3"})})
    found = by_entry(tmp_path / "all.zip")
    assert {one.name: one.files for one in found.values()} == {"Anna": {"wave.py": b"1"}, "Bo": {"w/wave.py": b"2"},
                                                               "Cy": {}}
    assert [one.problem for one in found.values()][2] == "the submission holds no Python file, only report.pdf"


def test_two_submissions_of_one_name_stay_two(tmp_path):
    put(tmp_path, {"li/wave.py": "1", "li.zip": zipped({"wave.py": "2"}), "li.py": "3"})
    found = by_entry(tmp_path)
    assert sorted(found) == ["li", "li (2)", "li (3)"]
    assert sorted(content for one in found.values() for content in one.files.values()) == [b"1", b"2", b"3"]


def test_each_unreadable_one_has_its_sentence_and_the_others_are_read(tmp_path):
    put(tmp_path, {"good/wave.py": "1", "broken.zip": "PK", "climber.zip": zipped({"../a.py": "1"}), "odd.rar": "x",
                   "inner/a.zip": "PK", "large/wave.py": b"#" * (2 << 20)})
    (tmp_path / "empty").mkdir()
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "wave.py").symlink_to("/etc/passwd")
    (tmp_path / "away").symlink_to("/etc")
    put(tmp_path, {"around/wave.py": "1"})
    (tmp_path / "around" / "lib").symlink_to("/etc")
    (tmp_path / "pipe").mkdir()
    os.mkfifo(tmp_path / "pipe" / "wave.py")
    found = by_entry(tmp_path)
    problems = {entry: one.problem for entry, one in found.items() if one.problem}
    for entry, words in {"broken": "broken.zip is damaged", "climber": "leads out of its folder", "empty": "is empty",
                         "odd": "is an archive of a kind that is not read", "inner": "a.zip is damaged",
                         "large": "wave.py has 2097152 bytes", "linked": "wave.py is a link, to /etc/passwd",
                         "away": "away is a link", "around": "lib is a link, to /etc",
                         "pipe": "wave.py is not a file"}.items():
        assert words in problems.pop(entry, ""), entry
        assert str(tmp_path) not in found[entry].problem
    assert problems == {}
    assert found["good"].files == {"wave.py": b"1"}


def test_a_pipe_that_calls_itself_an_archive(tmp_path):
    """Nobody writes to it, so reading would wait for ever."""
    put(tmp_path, {"good/wave.py": "1"})
    os.mkfifo(tmp_path / "evil.zip")
    found = by_entry(tmp_path)
    assert "no Python file" in found["evil"].problem and not found["good"].problem


def test_folders_in_folders_end_the_reading_of_their_submission_only(tmp_path):
    put(tmp_path, {"good/wave.py": "1"})
    folders = [str(tmp_path / "evil")]
    while len(folders) < 1100:
        folders.append(folders[-1] + "/a")
    for folder in folders:
        os.mkdir(folder)
    try:
        found = by_entry(tmp_path)
    finally:
        os.removedirs(folders[-1])
    assert found["evil"].problem == "the submission has more than 30 folders in each other"
    assert not found["good"].problem


def test_long_names_are_names_of_folders(tmp_path):
    """Of files as long as a disk allows, twice, and of longer ones in an archive."""
    name = "ä" * 126
    put(tmp_path, {name + ".py": "1", name + "/wave.py": "1"})
    put(tmp_path.with_suffix(".class"), {"all.zip": zipped({"n" * 300 + "/wave.py": "1", "good/wave.py": "1"})})
    for found in (by_entry(tmp_path), by_entry(tmp_path.with_suffix(".class") / "all.zip")):
        assert len(found) == 2
        for entry, one in found.items():
            assert len(entry.encode()) <= 245 and one.files


def test_a_name_that_is_no_utf8(tmp_path):
    os.mkdir(os.path.join(os.fsencode(tmp_path), b"\xe4nne"))
    put(tmp_path, {os.fsdecode(b"\xe4nne") + "/wave.py": "1"})
    assert by_entry(tmp_path)["\udce4nne"].files == {"wave.py": b"1"}


def test_what_is_no_folder_is_refused(tmp_path):
    put(tmp_path, {"wave.py": "1", "broken.zip": "PK"})
    for name, words in (("wave.py", "neither a folder nor"), ("broken.zip", "is damaged"), ("gone", "neither")):
        with pytest.raises(BadFolder, match=words):
            read_class(tmp_path / name)
