# SPDX-License-Identifier: BSD-3-Clause
"""Words that this project does not use, with the field's word for each. The tree keeps to it."""

import re

import pytest
from workspace_tree import ROOT, own_files

pytestmark = pytest.mark.tree

HERE = "tests/unit/test_words.py"
#: (words and phrases in lower case, what is written instead)
INSTEAD = (
    (("maker", "makers", "taker", "takers"), "publisher, handler"),
    (("mailbox", "letterbox", "inbox", "inboxes", "outbox", "outboxes"), "subscription, publisher"),
    (("mail",), "pending messages"),
    (("inlet", "inlets"), "connection"),
    (("request board", "place board"), "request queue"),
    (("brain", "brains"), "control logic"),
    (("for who", "to who", "from who", "the one who", "those who", "of who"),
     "for the renderer, to the caller, a client that waits"),
    (("neighbours were",), "on a shared virtual machine, beside other work"),
    (("anew",), "again; restart"),
    (("in vain",), "without success; failed tries"),
    (("for want of",), "because there is no …"),
    (("flat out",), "as fast as possible"),
    (("becomes of", "comes of", "came of"), "the result, the treatment of"),
    (("what there is", "what is due"), "the present entries, due messages"),
    (("who does so", "to be had", "oftener", "anybody", "anybody's"),
     "a noun and a plain verb: the caller, available, more often, any user"),
    (("shall",), "must, should, or the present tense"),
    (("stands twice", "stand twice"), "appears twice"),
    (("thread of its own", "process of its own", "master of its own", "world of its own", "lab of its own",
      "terminal of its own", "sandbox of its own"),
     "a separate thread"),
)
#: File -> words in it that others chose: names in messages, a part of the machine, licences.
OF_OTHERS = {
    "src/baxter/baxter_common/baxter_core_msgs/msg/AssemblyState.msg": {"brain"},
    "src/baxter/baxter_simulator/baxter_sim_hardware/src/baxter_sim_hardware/robot_state.py": {"brain"},
    # A heading of columns in Moodle's exports.
    "src/courses/rf_checks/src/rf_checks/roster.py": {"mail"},
    "src/courses/rf_checks/test/unit/test_checks_handout.py": {"mail"},
    "src/courses/rf_checks/test/unit/test_roster.py": {"mail"},
    "LICENSE": {"shall"},
    "tests/bench/recordings/LICENSE.klampt-examples": {"shall"},
}
#: Historical texts keep their old names.
HISTORY = ("CHANGELOG.rst", "docs/decisions/")
BINARY = (".png", ".dae", ".stl", ".svg", ".jpg", ".json", ".bag", ".rest")


def listed():
    """{word or phrase in lower case: what is said instead}."""
    return {word: instead for words, instead in INSTEAD for word in words}


def words_in(text, words):
    """Those of ``words`` in ``text``, alone or as a part of a name: brain in ``robot_brain`` and ``RobotBrain``."""
    split = " ".join(re.sub(r"(?<=[a-z0-9])(?=[A-Z])|_", " ", text).lower().split())
    # A search of a plain text is many times as fast, and nearly all words are in no file.
    return {word for word in words if word in split and re.search(r"\b%s\b" % re.escape(word), split)}


def test_the_tree_uses_the_fields_words():
    words, found = listed(), {}
    for name in own_files():
        if name == HERE or name.endswith((*HISTORY[:1], *BINARY)) or name.startswith(HISTORY[1:]):
            continue
        text = (ROOT / name).read_text(encoding="utf-8", errors="ignore")
        if hits := words_in(name + "\n" + text, words) - OF_OTHERS.get(name, set()):
            found[name] = {word: words[word] for word in hits}
    assert found == {}, "INSTEAD has the words to use"


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
