# SPDX-License-Identifier: BSD-3-Clause
"""Rosters, as teachers' programs write them, and wrong ones."""
import pytest

from lab_class import roster


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
    assert roster.read("name,id\nAnna,s123\n李雷,\n") == [("s123", "Anna"), ("student-02", "李雷")]


def test_letters_that_are_no_letter_with_a_mark_are_spelt_out():
    assert [student.name for student in roster.read("Søren Groß\nŁucja Æbelø\n")] == ["soren-gross", "lucja-aebelo"]


@pytest.mark.parametrize(("text", "words"), [
    ("", "empty"), ("team,group\na,1\n", "team, group"), ("name,id\nAnna,1\n,2\n", "line 3 has no name"),
    ("Anna\nBen\nanna\n", "lines 1 and 3"), ("Instructor\n", "\"instructor\" has another meaning"),
    ("Anna\nAll\n", "line 2: \"all\""), ("name\n", "0 students")])
def test_a_wrong_roster_says_where(text, words):
    with pytest.raises(roster.RosterError, match=words):
        roster.read(text)


@pytest.mark.parametrize("text", ["../../etc", "a/b", "A B", "x" * 300, "%2e%2e", "-"])
def test_no_name_leaves_its_folder(text):
    assert set(roster.slug(text)) <= set("abcdefghijklmnopqrstuvwxyz0123456789-") and len(roster.slug(text)) <= 40
