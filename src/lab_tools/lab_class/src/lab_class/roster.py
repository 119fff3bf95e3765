# SPDX-License-Identifier: BSD-3-Clause
"""Who is in the class: a number of students, or a CSV file. No ROS, no files."""
import csv
import io
import re
import unicodedata
from typing import NamedTuple

#: Students of one class; more is a mistake in the command.
MOST_STUDENTS = 500
#: Names that the front door uses itself, and the one that stands for every lab in commands.
RESERVED = ("instructor", "class", "all")
_LONGEST_NAME = 40
_COLUMNS = ("name", "student", "full name")
# Letters that are no ASCII letter with a mark; ß becomes ss by itself.
_LETTERS = str.maketrans({"æ": "ae", "œ": "oe", "ø": "o", "ł": "l", "đ": "d", "ð": "d", "þ": "th", "ı": "i"})


class RosterError(Exception):
    """The roster cannot be used; the text says which line, what was found, and what would have been right."""


class Student(NamedTuple):
    """``name``: the part of the address, a to z, 0 to 9 and hyphens; ``full_name``: as the roster has it."""

    name: str
    full_name: str


def numbered(count):
    """``count`` students: student-01, student-02, ... Raises RosterError."""
    if not 1 <= count <= MOST_STUDENTS:
        raise RosterError("%d students; a class has 1 to %d" % (count, MOST_STUDENTS))
    width = max(2, len(str(count)))
    return [Student("student-%0*d" % (width, number), "Student %d" % number) for number in range(1, count + 1)]


def read(text):
    """The students of a CSV file's text: one per line, with a header that has a column "name", or names alone.

    A column "id" gives the part of the address, else the name does. Raises RosterError.
    """
    text = text.removeprefix("\ufeff")
    first = text.partition("\n")[0]
    reader = csv.reader(io.StringIO(text), delimiter=";" if first.count(";") > first.count(",") else ",")
    rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    rows = [(number, row) for number, row in rows if any(row)]
    if not rows:
        raise RosterError("the roster is empty; it needs a name on each line")
    header = [cell.lower() for cell in rows[0][1]]
    name_column = next((header.index(column) for column in _COLUMNS if column in header), None)
    if name_column is None:
        if len(header) > 1:
            raise RosterError("the first line has the columns %s; one of them must be \"name\"" % ", ".join(header))
        name_column, id_column = 0, None
    else:
        id_column = header.index("id") if "id" in header else None
        rows = rows[1:]
    return _students(rows, name_column, id_column)


def _students(rows, name_column, id_column):
    students, seen = [], {}
    for line, row in rows:
        full_name = row[name_column] if len(row) > name_column else ""
        if not full_name:
            raise RosterError("line %d has no name" % line)
        given = row[id_column] if id_column is not None and len(row) > id_column else ""
        name = slug(given or full_name) or "student-%02d" % (len(students) + 1)
        if name in RESERVED:
            raise RosterError("line %d: \"%s\" has another meaning in addresses or commands; give this student another "
                              "id" % (line, name))
        if name in seen:
            raise RosterError("lines %d and %d both get the address /%s; a column \"id\" tells students with the same "
                              "name apart" % (seen[name], line, name))
        seen[name] = line
        students.append(Student(name, full_name))
    if not 1 <= len(students) <= MOST_STUDENTS:
        raise RosterError("the roster has %d students; a class has 1 to %d" % (len(students), MOST_STUDENTS))
    return students


def slug(text):
    """The part of an address that stands for a text: "" where no letter or digit of it is ASCII."""
    plain = unicodedata.normalize("NFKD", text.casefold().translate(_LETTERS)).encode("ascii", "ignore").decode()
    return re.sub(r"[^a-z0-9]+", "-", plain).strip("-")[:_LONGEST_NAME].strip("-")
