# SPDX-License-Identifier: BSD-3-Clause
"""Similarity of a program's own code to reference programs. Free of ROS.

Programs are compared by fingerprints: every sequence of SPAN tokens, after normalization of what a copyist changes
first (the program's own names, numbers, texts, comments, docstrings, annotations, formatting, order of functions).
Names of libraries and their methods stay. Code that was handed out to all students (skeletons, notebooks) counts on
neither side, so an untouched skeleton is not a copy of the solution made from it.
"""
from __future__ import annotations

import ast
import functools
import hashlib
import io
import json
import keyword
import re
import tokenize
from dataclasses import dataclass
from pathlib import Path

#: Tokens of a fingerprint: about two lines of code.
SPAN = 14
#: A program that shares this part of its own fingerprints, or of a reference's, is reported as a copy.
COPY_SHARE = 0.5
#: A program with fewer own fingerprints is not judged.
MIN_OWN = 40
#: Calls that run code which is not in the program, with their modules.
_OPAQUE = {"": ("exec", "eval", "compile", "__import__"), "runpy": ("run_path", "run_module"),
           "importlib": ("import_module",), "util": ("spec_from_file_location",), "machinery": ("SourceFileLoader",),
           "subprocess": ("Popen", "run", "call", "check_call", "check_output", "getoutput"),
           "os": ("system", "popen", "execv", "execve", "execvp", "execl", "execlp", "posix_spawn", "spawnv", "spawnl"),
           "ctypes": ("CDLL", "PyDLL")}
#: Texts in a program that name the judge or the solutions.
_JUDGES_OWN = re.compile(r"rf_checks|exercises.solutions|lab-judge-|LAB_JUDGE|LAB_RUN_CLOCK")


@dataclass(frozen=True)
class Likeness:
    """name: of the reference. of_program, of_reference: the share of each one's own code that is in the other (0 to
    1)."""

    name: str
    of_program: float
    of_reference: float

    @property
    def is_copy(self) -> bool:
        return max(self.of_program, self.of_reference) >= COPY_SHARE


class _Level(ast.NodeTransformer):
    """Normalize what a copyist changes first. Imported names are replaced by the full names of what they refer to."""

    def __init__(self, tree: ast.Module) -> None:
        self._own, self._imported = set(), {}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store | ast.Del):
                self._own.add(node.id)
            elif isinstance(node, ast.arg):
                self._own.add(node.arg)
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                self._own.add(node.name)
            elif isinstance(node, ast.ExceptHandler) and node.name:
                self._own.add(node.name)
            elif isinstance(node, ast.Import | ast.ImportFrom):
                for alias in node.names:
                    self._imported[alias.asname or alias.name.split(".")[0]] = alias.name.split(".")[-1]

    def visit_Name(self, node: ast.Name) -> ast.Name:
        node.id = "v" if node.id in self._own else self._imported.get(node.id, node.id)
        return node

    def visit_arg(self, node: ast.arg) -> ast.arg:
        node.arg, node.annotation = "v", None
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.Attribute:
        self.generic_visit(node)
        if node.attr in self._own:
            node.attr = "v"
        return node

    def visit_keyword(self, node: ast.keyword) -> ast.keyword:
        self.generic_visit(node)
        if node.arg in self._own:
            node.arg = "v"
        return node

    def visit_ExceptHandler(self, node: ast.ExceptHandler) -> ast.ExceptHandler:
        self.generic_visit(node)
        node.name = "v" if node.name else None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.Assign | None:
        self.generic_visit(node)
        return None if node.value is None else ast.Assign([node.target], node.value, lineno=node.lineno)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.Constant:
        return ast.Constant("s")

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        if isinstance(node.value, str | bytes):
            return ast.Constant("s")
        return ast.Constant(0) if isinstance(node.value, int | float | complex) and not isinstance(
            node.value, bool) else node

    def visit_Import(self, node: ast.Import | ast.ImportFrom) -> None:
        return None

    visit_ImportFrom = visit_Import

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        if isinstance(node.value, ast.Constant):  # a docstring
            return None
        self.generic_visit(node)
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> ast.AST:
        node.returns = None
        return self._definition(node)

    visit_AsyncFunctionDef = visit_FunctionDef

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        return self._definition(node)

    def _definition(self, node: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) -> ast.AST:
        self.generic_visit(node)
        node.name = "v"
        node.body = node.body or [ast.Pass()]
        return node


@functools.cache
def spans(text: str) -> tuple[bytes, ...]:
    """The hashes of a program's runs of tokens, in their order: tuple of bytes; empty for what Python cannot read."""
    try:
        tree = ast.parse(text)
        levelled = ast.unparse(ast.fix_missing_locations(_Level(tree).visit(tree)))
        tokens = [token.string for token in tokenize.generate_tokens(io.StringIO(levelled).readline)
                  if token.type in (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)]
    except (SyntaxError, ValueError, RecursionError, MemoryError, tokenize.TokenError):
        return ()
    return hashes(tokens)


def hashes(tokens: list[str]) -> tuple[bytes, ...]:
    """The hash of each run of SPAN tokens (texts): tuple of bytes."""
    return tuple(hashlib.blake2b("\0".join(tokens[k:k + SPAN]).encode("utf-8", "surrogatepass"), digest_size=8).digest()
                 for k in range(len(tokens) - SPAN + 1))


def fingerprints(text: str) -> frozenset[bytes]:
    """The set of hashes of a program's runs of tokens; empty for what Python cannot read."""
    return frozenset(spans(text))


def compare(text: str, references: dict[str, str], handed_out: list[str]) -> list[Likeness]:
    """Likenesses of a program to each reference, the most alike first.

    text: the program. references: {name: text}. handed_out: texts handed out to all students.
    """
    common = frozenset().union(*map(fingerprints, handed_out))
    own = fingerprints(text) - common
    if len(own) < MIN_OWN:
        return []
    found = []
    for name, reference in references.items():
        theirs = fingerprints(reference) - common
        if len(theirs) >= MIN_OWN:
            both = len(own & theirs)
            found.append(Likeness(name, both / len(own), both / len(theirs)))
    return sorted(found, key=lambda one: max(one.of_program, one.of_reference), reverse=True)


def opaque_calls(text: str) -> list[tuple[int, str]]:
    """(line, name) of calls that run code which is not in the program."""
    tree = _parsed(text)
    modules, functions = {}, {}
    for node in ast.walk(tree):
        for alias in node.names if isinstance(node, ast.Import | ast.ImportFrom) else ():
            modules[alias.asname or alias.name] = alias.name
            if isinstance(node, ast.ImportFrom) and node.module:
                functions[alias.asname or alias.name] = node.module.split(".")[-1], alias.name
    found = set()
    for call in (node.func for node in ast.walk(tree) if isinstance(node, ast.Call)):
        module, name = "", ""
        if isinstance(call, ast.Name):
            module, name = functions.get(call.id, ("", call.id))
        elif isinstance(call, ast.Attribute):
            # A module, or the last part of a dotted one; what a call returns is none.
            owner = getattr(call.value, "id", getattr(call.value, "attr", "()"))
            module, name = modules.get(owner, owner), call.attr
        if name in _OPAQUE.get(module, ()):
            found.add((call.lineno, "%s.%s" % (module, name) if module else name))
    return sorted(found)


def judges_own(text: str) -> list[tuple[int, str]]:
    """(line, text) of the texts in a program that name the judge's files."""
    constants = [node for node in ast.walk(_parsed(text)) if isinstance(node, ast.Constant)]
    return sorted({(node.lineno, node.value[:80]) for node in constants
                   if isinstance(node.value, str) and _JUDGES_OWN.search(node.value)})


def _parsed(text: str) -> ast.Module:
    """The tree of a program; an empty one for invalid Python."""
    try:
        return ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ast.Module([], [])


def notebook_code(path: Path) -> str:
    """The Python code of a notebook's cells, as one text."""
    cells = json.loads(Path(path).read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return "\n".join(text for text in code if _is_python(text))


def _is_python(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return not keyword.iskeyword(text.strip())


class References:
    """The references and handed-out texts of a workspace; a students' copy has no references."""

    def __init__(self, workspace: Path) -> None:
        """workspace: its folder."""
        root = Path(workspace)
        checks, lab = root / "src/courses/rf_checks/exercises", root / "src/courses/rf_lab2"
        solutions = [*sorted((checks / "solutions").glob("*.py")),
                     *(path for path in (lab / "nodes/tf_listener.py", lab / "nodes/wave.py") if path.is_file())]
        self.references = {str(path.relative_to(root)): _text(path) for path in solutions}
        self.handed_out = [_text(path) for path in sorted((checks / "skeletons").glob("*.py"))]
        #: How many of handed_out, the first ones, are skeletons.
        self.skeleton_count = len(self.handed_out)
        self.handed_out += [notebook_code(path) for path in sorted(root.glob("src/*/*/notebooks/*.ipynb"))]

    def notes(self, texts: dict[str, str]) -> list[str]:
        """Notes on a program for the instructor: a list of sentences. They change no points.

        texts: {name: text} of the program's files, the program itself first.
        """
        notes = []
        for place, (name, text) in enumerate(texts.items()):
            what, where = ("the program", "") if place == 0 else (name, " of %s" % name)
            likely = [one for one in compare(text, self.references, self.handed_out) if one.is_copy]
            if likely:
                one = likely[0]
                notes.append("%.0f %% of %s's own code is also in %s, and %.0f %% of that one's in %s, whatever the "
                             "names: compare the two"
                             % (100 * one.of_program, what, one.name, 100 * one.of_reference, what))
            for line, call in opaque_calls(text)[:3]:
                notes.append("line %d%s calls %s(), which runs code that cannot be read off the program"
                             % (line, where, call))
            for line, said in judges_own(text)[:3]:
                notes.append("line %d%s names what belongs to the check: %s" % (line, where, said))
        return notes


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")
