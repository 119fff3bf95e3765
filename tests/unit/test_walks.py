# SPDX-License-Identifier: BSD-3-Clause
"""docs/architecture.md follows a joint command and an IK request from function to function. The code agrees with the
page."""

import ast
import re

import pytest
from workspace_tree import ROOT

pytestmark = pytest.mark.tree

PAGE = ROOT / "docs" / "architecture.md"
WALKS = ("The way of a joint command", "The way of an IK request")
ROW = re.compile(r"\| (\d+) \| \[[^]]+\]\(\.\./([^)]+)\), `([\w.]+)` \| (\d+|start) \| .+ \|")


def steps(title):
    """[(number, file, name, number of the calling step or 0)] of the table below a heading."""
    section = PAGE.read_text(encoding="utf-8").split("## %s\n" % title)[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ") and not line.startswith("| |")]
    rows = [ROW.fullmatch(line) for line in lines]
    assert all(rows), [line for line, row in zip(lines, rows, strict=True) if not row]
    return [(int(row[1]), row[2], row[3], 0 if row[4] == "start" else int(row[4])) for row in rows]


def called(node):
    """The names that a definition or an assignment gives."""
    targets = node.targets if isinstance(node, ast.Assign) else [node]
    return [getattr(target, "id", getattr(target, "name", None)) for target in targets]


def definition(text, name):
    """The syntax tree of a function, class or class attribute, by its dotted name; None where there is none."""
    node = ast.parse(text)
    for part in name.split("."):
        inside = (child for child in ast.walk(node) if child is not node)
        node = next((child for child in inside if isinstance(child, ast.FunctionDef | ast.ClassDef | ast.Assign)
                     and part in called(child)), None)
        if node is None:
            break
    return node


def names_in(node):
    """All names and attributes that some code uses."""
    return {getattr(child, "attr", getattr(child, "id", None)) for child in ast.walk(node)}


def faults(rows, read):
    """Errors in the rows of :func:`steps`; ``read(file)``: its text."""
    nodes = {}
    for place, (number, file, name, origin) in enumerate(rows, 1):
        nodes[number] = definition(read(file), name)
        if number != place:
            yield "step %d is number %d of the table" % (number, place)
        elif nodes[number] is None:
            yield "step %d: %s has no %s" % (number, file, name)
        elif not origin < number:
            yield "step %d is reached from step %d, which comes later" % (number, origin)
        elif origin and nodes[origin] is not None and name.rpartition(".")[2] not in names_in(nodes[origin]):
            yield "step %d: %s is not named in step %d, %s" % (number, name, origin, rows[origin - 1][2])


@pytest.mark.parametrize("title", WALKS)
def test_each_step_exists_and_is_named_where_it_is_reached_from(title):
    rows = steps(title)
    assert len(rows) > 10
    assert list(faults(rows, lambda file: (ROOT / file).read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(("rows", "fault"), [
    ([(1, "a", "A.f", 0), (2, "a", "g", 1)], None),
    ([(1, "a", "A.f", 0), (2, "a", "A.gone", 1)], "has no A.gone"),
    ([(1, "a", "A.f", 0), (2, "a", "h", 1)], "h is not named in step 1"),
    ([(1, "a", "A.f", 0), (3, "a", "g", 1)], "number 2 of the table"),
    ([(1, "a", "A.f", 1)], "comes later"),
])
def test_what_has_changed_in_the_code_is_noticed(rows, fault):
    text = "class A:\n    def f(self):\n        return g()\ndef g(): 0\ndef h(): 0\n"
    found = list(faults(rows, lambda _: text))
    assert found == [] if fault is None else len(found) == 1 and fault in found[0]
