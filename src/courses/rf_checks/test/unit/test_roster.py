# SPDX-License-Identifier: BSD-3-Clause
"""Rosters, as teachers' programs write them, and wrong ones."""
import pytest

from rf_checks import roster


def test_a_number_of_students():
    students = roster.numbered(30)
    assert [students[0].name, students[-1].name] == ["student-01", "student-30"]
    assert roster.numbered(120)[0].name == "student-001"
    for count in (0, 501):
        with pytest.raises(roster.RosterError, match="1 to 500"):
            roster.numbered(count)


@pytest.mark.parametrize("text", [
    "name,team\nAnna Müller,a\nBen,b\n",
    "\ufeffteam;Name\r\na;Anna Müller\r\nb;Ben\r\n", "Anna Müller\n\nBen\n",
], ids=["commas", "semicolons of a spreadsheet", "names alone"])
def test_names_become_addresses(text):
    assert roster.read(text) == [("anna-muller", "Anna Müller"), ("ben", "Ben")]


def test_an_id_gives_the_address_and_other_scripts_get_a_number():
    anna, other = roster.read("name,id\nAnna,s123\n李雷,\n")
    assert anna == ("s123", "Anna") and other.full_name == "李雷" and other.name.startswith("student-")
    # In a roster of another order nobody gets the address, and so the files, of somebody else.
    assert {student.name: student.full_name for student in roster.read("李雷\n王伟\n张敏\n")} == \
        {student.name: student.full_name for student in roster.read("张敏\n李雷\n王伟\n")}


MOODLE = ('"First name",Surname,"ID number","Email address",Groups\r\nAnna,Müller,,anna.mueller@uni.example,"A, B"\r\n'
          'Anna,Müller,,a.mueller2@uni.example,\r\n')
MOODLE_GERMAN = "\ufeffVorname;Nachname;E-Mail-Adresse\r\nJürgen;von der Heide;heide@uni.example\r\n"
CANVAS = ('Student,ID,SIS User ID,SIS Login ID,Section,Quiz 1 (23),Final Score\n'
          '    Points Possible,,,,,10.00,(read only)\n'
          '"Müller, Anna",11,4711,amueller,XC 101,8.00,80\n"O\'Neil, Séan",12,4712,soneil@school.example,XC 101,,\n'
          '"Student, Test",13,,6f1c2d,XC 101,,\n')
CLASSROOM = ("Last Name,First Name,Email Address,Lab 1\nDate,,,2026-11-26\nPoints,,,20\n"
             "Müller,Anna,anna@school.example,10\n")


@pytest.mark.parametrize(("text", "students"), [
    (MOODLE, [("anna-mueller", "Anna Müller"), ("a-mueller2", "Anna Müller")]),
    (MOODLE_GERMAN, [("heide", "Jürgen von der Heide")]),
    (CANVAS, [("amueller", "Anna Müller"), ("soneil", "Séan O'Neil")]),
    (CLASSROOM, [("anna", "Anna Müller")]),
    ("Name\tUsername\nAnna Müller, PhD\tam\n", [("am", "Anna Müller, PhD")]),
], ids=["Moodle, two of one name", "Moodle in German", "Canvas", "Google Classroom", "tabs"])
def test_exports_are_taken_as_they_are(text, students):
    assert roster.read(text) == students


def test_encodings_of_spreadsheets():
    text = "name\nAnna Müller\n"
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        assert roster.read(roster.text_of(text.encode(encoding))) == [("anna-muller", "Anna Müller")]
    for data in (text.encode("latin-1"), "name\nAnna\n".encode("utf-16-le"), b"PK\x03\x04\xff\x00", b"\xff\xfea"):
        with pytest.raises(roster.RosterError, match="CSV UTF-8"):
            roster.text_of(data)


def test_a_name_cannot_control_a_terminal():
    assert roster.read("name\nAn\x1b[31mna\n")[0].full_name == "An[31mna"


def test_letters_that_are_no_letter_with_a_mark_are_spelt_out():
    assert [student.name for student in roster.read("Søren Groß\nŁucja Æbelø\n")] == ["soren-gross", "lucja-aebelo"]


@pytest.mark.parametrize(("text", "words"), [
    ("", "empty"), ("team,group\na,1\n", "team, group"), ("name,id\nAnna,1\n,2\n", "line 3 has no name"),
    ("Anna\nBen\nanna\n", "lines 1 and 3"), ("Instructor\n", "\"instructor\" has another meaning"),
    ("Anna\nAll\n", "line 2: \"all\""), ("name\n", "0 students"), ("First name,Email\nAnna,a@b\n", "\"last name\""),
    ("name,x\nAnna,\"%s\n" % ("y" * 140000), "line 2 of the roster cannot be read")])
def test_a_wrong_roster_says_where(text, words):
    with pytest.raises(roster.RosterError, match=words):
        roster.read(text)


@pytest.mark.parametrize("text", ["../../etc", "a/b", "A B", "x" * 300, "%2e%2e", "-"])
def test_no_name_leaves_its_folder(text):
    assert set(roster.slug(text)) <= set("abcdefghijklmnopqrstuvwxyz0123456789-") and len(roster.slug(text)) <= 40
