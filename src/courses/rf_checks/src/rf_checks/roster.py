# SPDX-License-Identifier: BSD-3-Clause
"""The students of a class: a number of students, or a CSV file. No ROS, no files."""
from __future__ import annotations

import codecs
import csv
import hashlib
import io
import re
import unicodedata
from typing import NamedTuple

#: Students of one class; more is a mistake in the command.
MAX_STUDENTS = 500
#: Names that the front door uses itself, and the one that stands for every lab in commands.
INSTRUCTOR = "instructor"
RESERVED = (INSTRUCTOR, "class", "all")
_LONGEST_NAME = 40
# Headings of columns, as they are in exports of Moodle, Canvas and Google Classroom; English, and Moodle's German.
_NAMES = ("name", "student", "full name", "student name", "vollständiger name")
_FIRST_NAMES, _LAST_NAMES = ("first name", "firstname", "vorname"), ("last name", "lastname", "surname", "nachname")
# Columns that tell students apart: the first of them that is there gives the addresses, of an email address the part
# before the @. A column "id" is Canvas's own number where there is a login, too.
_LOGINS = ("sis login id", "login id", "id", "username", "anmeldename", "email address", "e-mail address", "email",
           "e-mail-adresse", "e-mail", "id number", "id-nummer")
# Rows of gradebooks that are not students: they have no login, or are Canvas's student for trying things out.
_NO_STUDENTS = ("points possible", "points", "date", "class average", "student, test", "test student")
_DELIMITERS = ",;\t"
# Letters that are no ASCII letter with a mark; ß becomes ss by itself.
_LETTERS = str.maketrans({"æ": "ae", "œ": "oe", "ø": "o", "ł": "l", "đ": "d", "ð": "d", "þ": "th", "ı": "i"})


class RosterError(Exception):
    """The roster cannot be used; the text says which line, what was found, and what would have been right."""


class Student(NamedTuple):
    """``name``: the part of the address, a to z, 0 to 9 and hyphens; ``full_name``: as the roster has it."""

    name: str
    full_name: str


def numbered(count: int) -> list[Student]:
    """``count`` students: student-01, student-02, ... Raises RosterError."""
    if not 1 <= count <= MAX_STUDENTS:
        raise RosterError("%d students; a class has 1 to %d" % (count, MAX_STUDENTS))
    width = max(2, len(str(count)))
    return [Student("student-%0*d" % (width, number), "Student %d" % number) for number in range(1, count + 1)]


def text_of(data: bytes) -> str:
    """The text of a roster's bytes: UTF-8, or UTF-16 with its mark. Raises RosterError."""
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise RosterError('is not UTF-8 (line %d); in a spreadsheet, save it as "CSV UTF-8"'
                          % (1 + data.count(b"\n", 0, error.start))) from error
    if "\0" in text:
        raise RosterError('is no text; in a spreadsheet, save it as "CSV UTF-8"')
    return text


def read(text: str) -> list[Student]:
    """The students of a CSV file's text: one per line, with a header, or names alone. Separated by comma, semicolon or
    tab.

    The header has a column for names, or one for first and one for last names; a column of _LOGINS gives the addresses,
    else the names do. Raises RosterError.
    """
    first = text.lstrip("\ufeff").partition("\n")[0]
    delimiter = max(_DELIMITERS, key=first.count)
    reader = csv.reader(io.StringIO(text.lstrip("\ufeff")), delimiter=delimiter)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise RosterError("line %d of the roster cannot be read: %s" % (reader.line_num, error)) from error
    rows = [(number, row) for number, row in rows if any(row)]
    if not rows:
        raise RosterError("the roster is empty; it needs a name on each line")
    header = [" ".join(cell.lower().split()) for cell in rows[0][1]]
    names = _names_of(header)
    if names is None:
        if len(header) > 1:
            raise RosterError("the first line has the columns %s; one of them must be \"name\", or two of them \"first "
                              "name\" and \"last name\"" % ", ".join(header))
        return _students([(line, row[0], "") for line, row in rows])
    login = _column(header, _LOGINS)
    found = [(line, " ".join(filter(None, (_cell(row, column) for column in names))), _cell(row, login))
             for line, row in rows[1:]]
    # Canvas has the last name first, and a comma.
    is_turned = header[names[0]] == "student"
    return _students([(line, _in_order(name) if is_turned else name, key) for line, name, key in found
                      if name.lower() not in _NO_STUDENTS or (key and "test" not in name.lower())])


def _column(header: list[str], headings: tuple[str, ...]) -> int | None:
    return next((header.index(heading) for heading in headings if heading in header), None)


def _names_of(header: list[str]) -> list[int] | None:
    """The columns that make a student's name together, or None."""
    whole, first, last = (_column(header, headings) for headings in (_NAMES, _FIRST_NAMES, _LAST_NAMES))
    if whole is not None:
        return [whole]
    return None if first is None or last is None else [first, last]


def _cell(row: list[str], column: int | None) -> str:
    return row[column] if column is not None and len(row) > column else ""


def _in_order(name: str) -> str:
    """First and last name of "last, first"; any other name as it is."""
    last, comma, first = name.partition(",")
    return "%s %s" % (first.strip(), last.strip()) if comma and first.strip() and "," not in first else name


def _students(rows: list[tuple[int, str, str]]) -> list[Student]:
    """rows: (line, full name, what tells this student apart or "")."""
    students, seen = [], {}
    for line, text, key in rows:
        full_name = "".join(sign for sign in text if sign.isprintable())
        if not full_name:
            raise RosterError("line %d has no name" % line)
        name = slug(key.partition("@")[0]) or slug(full_name) or _number_of(full_name)
        if name in RESERVED:
            raise RosterError("line %d: \"%s\" has another meaning in addresses or commands; give this student another "
                              "id" % (line, name))
        if name in seen:
            raise RosterError("lines %d and %d both get the address /%s; a column \"id\" tells students with the same "
                              "name apart" % (seen[name], line, name))
        seen[name] = line
        students.append(Student(name, full_name))
    if not 1 <= len(students) <= MAX_STUDENTS:
        raise RosterError("the roster has %d students; a class has 1 to %d" % (len(students), MAX_STUDENTS))
    return students


def _number_of(full_name: str) -> str:
    """For a name of other letters: the same in each roster, whatever the order."""
    return "student-" + hashlib.sha256(full_name.encode("utf-8", "surrogatepass")).hexdigest()[:8]


def slug(text: str) -> str:
    """The part of an address that stands for a text: "" where no letter or digit of it is ASCII."""
    plain = unicodedata.normalize("NFKD", text.casefold().translate(_LETTERS)).encode("ascii", "ignore").decode()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:_LONGEST_NAME].strip("-")
