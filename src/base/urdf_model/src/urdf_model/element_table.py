# SPDX-License-Identifier: BSD-3-Clause
"""Which elements of a format have an effect here: a table by path, and a walk that finds those that have none."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

_FLAGS = {"true": "1", "false": "0"}
# As Gazebo's readers do, which take what a word begins with.
_LEADING_NUMBER = re.compile(r"[-+]?(\d|\.\d|inf|nan)")
#: Why a number that nobody reads is named.
NO_NUMBER = "not all of this text is numbers"


class ElementRow(NamedTuple):
    """An element: ``reason`` says why it has no effect, "" for one that is honoured.

    ``harmless``: the texts, with | between them, with which it has none in Gazebo either; None where its presence
    counts. ``<=0.1`` is a number of at most that.
    """

    reason: str = ""
    harmless: str | None = None


class Idle(NamedTuple):
    """Elements without an effect; ``unknown``: they are in no table."""

    tag: str
    line: int
    reason: str
    unknown: bool


class ElementTable:
    """Rows by path, such as ``surface/friction/ode/mu2``. A path begins at the nearest of ``scopes``, unless the table
    has rows of the longer one.

    ``known``: mappings of a path to the names of the elements in it, with blanks between them, that are honoured or
    need not be. ``without_effect``: rows of (path, {name: harmless texts or None}, reason). The elements on the way to
    a path are honoured. Only elements of which the table has a child are looked into. ``numbers``: paths of elements
    that nobody reads, but that hold numbers or flags; another text in them is named.
    """

    def __init__(self, known: Iterable[Mapping[str, str]],
                 without_effect: Iterable[tuple[str, Mapping[str, str | None], str]], scopes: Iterable[str] = (),
                 numbers: Iterable[str] = ()):
        self.scopes = frozenset(scopes)
        self.numbers = frozenset(numbers)
        self.rows: dict[str, ElementRow] = {}
        for path, names in ((path, names) for mapping in known for path, names in mapping.items()):
            self._add_way(path)
            self.rows.update(("%s/%s" % (path, name), ElementRow()) for name in names.split())
        for path, names, reason in without_effect:
            self._add_way(path)
            self.rows.update(("%s/%s" % (path, name), ElementRow(reason, harmless)) for name, harmless in names.items())
        #: Paths of which the table has children.
        self.parents = {path.rpartition("/")[0] for path in self.rows}

    def _add_way(self, path):
        words = path.split("/")
        for count in range(2, len(words) + 1):
            self.rows.setdefault("/".join(words[:count]), ElementRow())

    def find(self, element: Any, path: str) -> Iterator[Idle]:
        """Yield what has no effect in ``element``, which is at ``path``. Elements of other name spaces are ignored."""
        for child in element.iterchildren("*"):
            if ":" in child.tag or "}" in child.tag:
                continue
            row = self.rows.get("%s/%s" % (path, child.tag))
            if row is None:
                yield Idle(child.tag, child.sourceline, "", True)
            elif not row.reason:
                inside = "%s/%s" % (path, child.tag)
                if inside in self.numbers and not _holds_numbers(content(child)):
                    yield Idle(child.tag, child.sourceline, NO_NUMBER, False)
                if child.tag in self.scopes and inside not in self.parents:
                    inside = child.tag
                if inside in self.parents:
                    yield from self.find(child, inside)
            elif row.harmless is None or not any(_is(content(child), text) for text in row.harmless.split("|")):
                yield Idle(child.tag, child.sourceline, row.reason, False)


class IdleElements:
    """Collects elements without an effect, from one or several files, for one line that names them."""

    def __init__(self) -> None:
        self._unknown: dict[str, dict[str, list[Any]]] = {}
        self._reasons: dict[str, dict[str, dict[str, list[Any]]]] = {}

    def add(self, idle: Idle, source: str) -> None:
        """Add an element of file ``source``."""
        tags = self._unknown if idle.unknown else self._reasons.setdefault(idle.reason, {})
        add_place(tags, idle.tag, source, idle.line)

    def text(self) -> str:
        """The line, "" where nothing was added."""
        reasons = "; ".join("%s: %s" % (reason, placed(tags)) for reason, tags in self._reasons.items())
        unknown = placed(self._unknown)
        return "; ".join(filter(None, (reasons and "without an effect here: " + reasons,
                                       unknown and "not known and left out: " + unknown)))


def add_place(table: dict[str, dict[str, list[Any]]], what: str, source: str, line: Any) -> None:
    """Note in ``table`` that ``what`` is in a line of file ``source``."""
    lines = table.setdefault(what, {}).setdefault(source, [])
    if line not in lines:
        lines.append(line)


def placed(table: Mapping[str, Mapping[str, list[Any]]]) -> str:
    """Return the entries of a table of :func:`add_place` with their files and lines."""
    parts = []
    for what, files in table.items():
        places = ("%s line %s" % (source, ", ".join(map(str, lines))) for source, lines in files.items())
        parts.append("%s (%s)" % (what, "; ".join(places)))
    return ", ".join(parts)


def content(element: Any) -> str:
    """The attribute ``value`` of an element, as older files for Gazebo have it, or its text."""
    return element.get("value", element.text or "").strip()


def _is(text, harmless):
    """Whether ``text`` is the text that ``harmless`` means."""
    if harmless.startswith("<="):
        return _number(text) <= float(harmless[2:])
    return _same(text, harmless)


def _number(text):
    """The number in ``text``; NaN, which is neither more nor less than any, where there is none; 0 for nothing."""
    try:
        return float(text or 0.0)
    except ValueError:
        return math.nan


def _holds_numbers(text):
    return all(word in _FLAGS or _LEADING_NUMBER.match(word) for word in text.lower().split())


def _same(text, other):
    text, other = text.lower(), other.strip().lower()
    if not text or text == other or _FLAGS.get(text, text) == _FLAGS.get(other, other):
        return True
    try:
        return [float(word) for word in text.split()] == [float(word) for word in other.split()]
    except ValueError:
        return False
