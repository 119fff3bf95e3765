# SPDX-License-Identifier: BSD-3-Clause
"""Disguised copies are reported; honest programs with similar structure are not."""
import ast
import re
from pathlib import Path

import pytest

from rf_checks import similarity, submission

WORKSPACE = Path(__file__).resolve().parents[5]
EXERCISES = WORKSPACE / "src/courses/rf_checks/exercises"
NAMES = sorted(path.name for path in (EXERCISES / "solutions").glob("*.py"))
LIBRARY = similarity.References(WORKSPACE)


def notes(text):
    return LIBRARY.notes({"program.py": text})


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
        note, = notes(text)
        assert "exercises/solutions/" + name in note


@pytest.mark.parametrize("name", NAMES)
def test_an_untouched_skeleton_is_no_copy(name):
    skeleton = (EXERCISES / "skeletons" / name).read_text(encoding="utf-8")
    assert notes(skeleton) == []
    # Nor is one with a little work in it.
    assert notes(skeleton + "\n\ndef extra(a, b):\n    return [x * a + b for x in range(10) if x > a]\n") == []


@pytest.mark.parametrize("folder", ["src/courses/rf_checks/test/wrong", "src/baxter/baxter_examples/scripts"])
def test_programs_of_other_people_are_no_copies(folder):
    for path in sorted((WORKSPACE / folder).glob("*.py")):
        found = similarity.compare(path.read_text(encoding="utf-8"), LIBRARY.references, LIBRARY.handed_out)
        assert not any(one.is_copy for one in found), (path, found[:1])


def test_what_notebooks_show_may_be_used():
    shown = similarity.notebook_code(WORKSPACE / "src/courses/rf_lab2/notebooks/7_waving.ipynb")
    assert len(similarity.fingerprints(shown)) > similarity.MIN_OWN
    assert notes(shown) == []


def test_what_cannot_be_read_is_noted():
    for call in ("exec(c)", "runpy.run_path(p)", "importlib.util.spec_from_file_location('m', p)", "os.system('x')",
                 "subprocess.run(['x'])"):
        assert notes("import runpy, os, subprocess\n%s\n" % call) == [
            "line 2 calls %s(), which runs code that cannot be read off the program"
            % call.split("(")[0].removeprefix("importlib.")]
    for text in ("from runpy import run_path as load\nload(p)\n", "import runpy as r\nr.run_path(p)\n"):
        assert notes(text) == ["line 2 calls runpy.run_path(), which runs code that cannot be read off the program"]
    assert notes("import re\nre.compile('x')\nrunner.run(1)\n") == []


def test_the_files_of_the_check_are_none_of_a_programs_business():
    note, = notes("import os\nprint(os.listdir(os.environ['LAB_ROOT'] + '/src/courses/rf_checks/exercises'))\n")
    assert note == "line 2 names what belongs to the check: /src/courses/rf_checks/exercises"


@pytest.mark.parametrize("name", NAMES[:1])
def test_a_module_beside_the_program_is_looked_at_as_well(name):
    note, = LIBRARY.notes({"mine.py": "import helper\nhelper.main()\n", "helper.py": disguised(solution(name))})
    assert "of helper.py's own code is also in" in note
    assert "exercises/solutions/" + name in note


@pytest.mark.parametrize("text", ["", "print 'old'", "\0", "(" * 500])
def test_what_python_cannot_read_has_no_likeness(text):
    assert similarity.fingerprints(text) == frozenset()
    assert notes(text) == []


@pytest.mark.parametrize("encoding, expected", [
    ("utf-7", "# coding: utf-7\nprint('ü+')\n"), ("latin-1", "# coding: latin-1\nprint('ü+')\n"),
    ("no-such", "# coding: no-such\nprint('ü+')\n"), ("zlib", "# coding: zlib\nprint('ü+')\n")])
def test_programs_are_compared_as_python_reads_them(encoding, expected):
    """With another encoding a copy looks like no program at all."""
    codec = encoding if encoding in ("utf-7", "latin-1") else "utf-8"
    head, _, body = expected.partition("\n")
    assert submission.decoded(head.encode() + b"\n" + body.encode(codec)) == expected
