# SPDX-License-Identifier: BSD-3-Clause
"""CONTRIBUTING.md lists words that this project does not use, with the field's word for each. The tree keeps to it."""

import re

import pytest
from workspace_tree import ROOT, own_files

pytestmark = pytest.mark.tree

LIST, HERE = "CONTRIBUTING.md", "tests/unit/test_words.py"
#: File -> words in it that others chose: names in messages, a part of the machine, licences.
OF_OTHERS = {
    "src/baxter/baxter_common/baxter_core_msgs/msg/AssemblyState.msg": {"brain"},
    "src/baxter/baxter_simulator/baxter_sim_hardware/src/baxter_sim_hardware/robot_state.py": {"brain"},
    # A heading of columns in Moodle's exports.
    "src/lab_tools/lab_environment/src/lab_environment/roster.py": {"mail"},
    "src/lab_tools/lab_environment/test/unit/test_roster.py": {"mail"},
    "LICENSE": {"shall"},
    "tests/bench/recordings/LICENSE.klampt-examples": {"shall"},
}
#: Historical texts keep their old names.
HISTORY = ("CHANGELOG.rst", "docs/decisions/")
BINARY = (".png", ".dae", ".stl", ".svg", ".jpg", ".json", ".bag", ".rest")


def listed():
    """{word or phrase in lower case: what is said instead}, from the table in CONTRIBUTING.md."""
    table = re.search(r"\n\| not \| but \|\n\|[-|]+\|\n((?:\|.*\n)+)", (ROOT / LIST).read_text(encoding="utf-8"))[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return {word.lower(): instead for words, instead in rows for word in re.findall("`([^`]+)`", words)}


def words_in(text, words):
    """Those of ``words`` in ``text``, alone or as a part of a name: brain in ``robot_brain`` and ``RobotBrain``."""
    split = " ".join(re.sub(r"(?<=[a-z0-9])(?=[A-Z])|_", " ", text).lower().split())
    # A search of a plain text is many times as fast, and nearly all words are in no file.
    return {word for word in words if word in split and re.search(r"\b%s\b" % re.escape(word), split)}


def test_the_tree_uses_the_fields_words():
    words, found = listed(), {}
    for name in own_files():
        if name in (LIST, HERE) or name.endswith((*HISTORY[:1], *BINARY)) or name.startswith(HISTORY[1:]):
            continue
        text = (ROOT / name).read_text(encoding="utf-8", errors="ignore")
        if hits := words_in(name + "\n" + text, words) - OF_OTHERS.get(name, set()):
            found[name] = {word: words[word] for word in hits}
    assert found == {}, "the table in CONTRIBUTING.md has the words to use"


@pytest.mark.parametrize(("text", "word"), [
    ("class RequestBoard:", "request board"), ("self._inlets = InletHub()", "inlet"), ("robot_brain", "brain"),
    ("for the one\n    who asked", "the one who")])
def test_a_word_is_found_in_names_and_across_lines(text, word):
    assert words_in(text, [word]) == {word}


@pytest.mark.parametrize(("text", "word"), [("<maintainer email='me@example.org'>", "mail"), ("markers", "maker")])
def test_a_part_of_another_word_is_not_found(text, word):
    assert words_in(text, [word]) == set()


def test_settings_are_named_by_what_they_set():
    """There were five classes of this name."""
    found = [name for name in own_files() if name.endswith(".py") and name != HERE
             and re.search(r"^class Settings\b", (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)]
    assert len(found) <= 1, found


def test_every_excuse_is_needed():
    for name, words in OF_OTHERS.items():
        assert words_in((ROOT / name).read_text(encoding="utf-8"), listed()) >= words
