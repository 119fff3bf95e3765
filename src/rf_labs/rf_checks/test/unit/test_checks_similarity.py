# SPDX-License-Identifier: BSD-3-Clause
"""Copies are named, whatever was done to hide them; honest programs are not, whatever they have in common."""
import ast
import re
from pathlib import Path

import pytest

from rf_checks import similarity

WORKSPACE = Path(__file__).resolve().parents[5]
EXERCISES = WORKSPACE / "src/rf_labs/rf_checks/exercises"
NAMES = sorted(path.name for path in (EXERCISES / "solutions").glob("*.py"))
LIBRARY = similarity.Library(WORKSPACE)


def solution(name):
    return (EXERCISES / "solutions" / name).read_text(encoding="utf-8")


def disguised(text):
    """Other names, texts and numbers, another order of functions, other formatting, remarks, aliases."""
    tree = ast.parse(text)
    own = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    own |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    own |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    others = [node for node in tree.body if not isinstance(node, ast.FunctionDef)]
    tree.body = [*others[:-1], *reversed(functions), others[-1]]
    text = re.sub(r"(?<![\w.\"'])(%s)\b(?!['\"])" % "|".join(sorted(own, key=len, reverse=True)),
                  lambda found: "my_" + found[0], ast.unparse(tree))
    text = text.replace("import numpy as np", "import numpy as numerics").replace("np.", "numerics.")
    return "# all my own work\n" + text.replace("'", '"').replace("\n\n", "\n\n\n# and on\n")


@pytest.mark.parametrize("name", NAMES)
def test_a_copy_is_named_also_in_disguise(name):
    for text in (solution(name), disguised(solution(name))):
        note, = LIBRARY.notes(text)
        assert "exercises/solutions/" + name in note


@pytest.mark.parametrize("name", NAMES)
def test_an_untouched_skeleton_is_no_copy(name):
    skeleton = (EXERCISES / "skeletons" / name).read_text(encoding="utf-8")
    assert LIBRARY.notes(skeleton) == []
    # Nor is one with a little work in it.
    assert LIBRARY.notes(skeleton + "\n\ndef extra(a, b):\n    return [x * a + b for x in range(10) if x > a]\n") == []


@pytest.mark.parametrize("folder", ["src/rf_labs/rf_checks/test/wrong", "src/baxter/baxter_examples/scripts"])
def test_programs_of_other_people_are_no_copies(folder):
    for path in sorted((WORKSPACE / folder).glob("*.py")):
        found = similarity.compare(path.read_text(encoding="utf-8"), LIBRARY.references, LIBRARY.handed_out)
        assert not any(one.is_copy for one in found), (path, found[:1])


def test_what_notebooks_show_may_be_used():
    shown = similarity.notebook_code(WORKSPACE / "src/rf_labs/rf_lab2/notebooks/7_waving.ipynb")
    assert len(similarity.fingerprints(shown)) > similarity.LEAST_OWN
    assert LIBRARY.notes(shown) == []


def test_what_cannot_be_read_is_noted():
    notes = LIBRARY.notes("import base64\nexec(base64.b64decode('cHJpbnQoMSk='))\n")
    assert notes == ["line 2 calls exec(), which runs code that cannot be read off the program"]


@pytest.mark.parametrize("text", ["", "print 'old'", "\0", "(" * 500])
def test_what_python_cannot_read_has_no_likeness(text):
    assert similarity.fingerprints(text) == frozenset()
    assert LIBRARY.notes(text) == []
