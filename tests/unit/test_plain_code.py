# SPDX-License-Identifier: BSD-3-Clause
"""No module is imported for a side effect, no function has too many parameters, no docstring asks a question, no two
classes have one name."""

import ast
import re
from pathlib import Path

import pytest
from workspace_tree import ROOT, is_in_tests, is_python, own_files

pytestmark = pytest.mark.tree

MAX_PARAMETERS = 7


def product_code():
    """(file, text) of every Python file that is not a test."""
    return [(name, (ROOT / name).read_text(encoding="utf-8")) for name in own_files()
            if is_python(name) and not is_in_tests(name)]


def test_no_module_is_imported_for_its_side_effects():
    """ruff finds unused imports; no comment may silence it."""
    assert [name for name, text in product_code() if "noqa: F401" in text] == []


def test_bounds_are_called_max_and_min():
    bounds = re.compile(r"(?<![A-Z])(?:MOST|LEAST)_[A-Z]")
    assert [name for name, text in product_code() if bounds.search(text)] == []


def classes_by_name(files):
    """{name: [folder, ...]} of the public classes at the top of files [(path, text)]."""
    found = {}
    for name, text in files:
        for node in ast.parse(text).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(Path(name).parent.name)
    return found


def test_public_classes_have_names_of_their_own():
    rows = re.findall(r"^\| ((?:`[A-Z]\w+`(?:, )?)+) \| ((?:`\w+`(?:, )?)+) \|",
                      (ROOT / "docs/architecture.md").read_text(encoding="utf-8"), re.MULTILINE)
    listed = {one: sorted(re.findall(r"\w+", folders)) for names, folders in rows for one in re.findall(r"\w+", names)}
    shared = {one: sorted(folders) for one, folders in classes_by_name(product_code()).items() if len(folders) > 1}
    assert shared == listed


def test_classes_of_one_name_are_noticed():
    files = [("a/b.py", "class A: pass\nclass _B: pass"), ("c/d.py", "class A: pass")]
    assert classes_by_name(files) == {"A": ["a", "c"]}


def riddles(name, text):
    """"file:line" of docstrings that begin with a word of questions."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if re.match(r"\s*(?:What|Who)\b", ast.get_docstring(node, clean=False) or ""):
                yield f"{name}:{node.body[0].lineno}"


def test_docstrings_say_what_a_thing_is_or_does():
    texts = ((name, (ROOT / name).read_text(encoding="utf-8")) for name in own_files() if is_python(name))
    assert [one for name, text in texts for one in riddles(name, text)] == []


@pytest.mark.parametrize("text", [
    '"""What it is."""', 'class A:\n    """Who comes."""', 'def a():\n    """What\n    it is."""'])
def test_a_question_is_noticed(text):
    assert len(list(riddles("a.py", text))) == 1


def crowded(name, text):
    """"file function" of functions with more than MAX_PARAMETERS parameters, self not counted."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            names = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            if len(names) - (names[:1] in (["self"], ["cls"])) > MAX_PARAMETERS:
                yield f"{Path(name).name} {node.name}"


def test_functions_take_few_parameters_or_named_groups_of_them():
    assert [one for name, text in product_code() for one in crowded(name, text)] == [], "group these parameters"


def test_a_crowd_is_noticed():
    text = "def many(a, b, c, d, e, f, g, *, h): pass\nclass A:\n    def few(self, a, b, c, d, e, f, g): 0"
    assert list(crowded("src/a.py", text)) == ["a.py many"]
