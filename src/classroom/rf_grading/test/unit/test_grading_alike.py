# SPDX-License-Identifier: BSD-3-Clause
"""Copies are found whatever their names and order; independent and handed-out programs are not."""
import random
import re
from pathlib import Path

import pytest

from rf_grading import alike

EXERCISES = Path(__file__).resolve().parents[4] / "courses" / "rf_checks" / "exercises"
SOLUTIONS = {path.stem: path.read_text() for path in sorted((EXERCISES / "solutions").glob("*.py"))}
SKELETONS = {path.stem: path.read_text() for path in sorted((EXERCISES / "skeletons").glob("*.py"))}
pytestmark = pytest.mark.skipif(not SOLUTIONS, reason="a students' copy has no solutions")


def disguised(text):
    """With other names, numbers, texts and remarks."""
    for number, word in enumerate(("gripper", "pose", "limb", "angles", "command", "side", "target", "request")):
        text = re.sub(r"\b%s\b" % word, "thing_%d" % number, text)
    text = re.sub(r"\b\d+\.\d+\b", "7.5", text)
    return "# all mine\n" + re.sub(r"#.*", "", text)


def found(texts, handed_out=()):
    return [(pair.first, pair.second) for pair in alike.pairs({k: [v] for k, v in texts.items()}, handed_out)]


def test_a_disguised_copy_is_found_and_other_programs_are_not():
    texts = {**SOLUTIONS, "copy": disguised(SOLUTIONS["rotate_gripper"])}
    assert found(texts, SKELETONS.values()) == [("copy", "rotate_gripper")]


def test_what_was_handed_out_is_not_a_copy():
    texts = {"a": SKELETONS["wave"], "b": SKELETONS["wave"], "c": SKELETONS["wave"] + "\nprint('x')\n"}
    assert found(texts, SKELETONS.values()) == []
    assert found({"a": SKELETONS["rotate_gripper"], "b": disguised(SKELETONS["rotate_gripper"])}) == [("a", "b")]


def test_common_knowledge_of_a_class_is_not_a_copy():
    common = SOLUTIONS["joint_command"]
    rng = random.Random(3)
    own = ["\n".join("f.a%d(g.b%d, h.c%d)" % tuple(rng.choices(range(40), k=3)) for _ in range(12)) for _ in range(20)]
    texts = {"s%d" % k: common + "\n" + text for k, text in enumerate(own)}
    assert found(texts) == []
    assert len(found(dict(list(texts.items())[:3]))) == 3


def test_equal_files_are_told_even_where_many_have_them_or_they_are_short():
    texts = {"s%d" % k: SOLUTIONS["wave"] for k in range(8)}
    assert len(found(texts)) == 28
    short = "import rospy\nrospy.init_node('a')\nrospy.loginfo('x %s', 1 + 2 + 3 + 4 + 5)\nrospy.spin()\n"
    (pair,) = alike.pairs({"a": [short], "b": [short]}, [])
    assert pair.is_same


def test_python_2_is_compared_too():
    text = SOLUTIONS["wave"] + "\nprint 'done'\n"
    assert found({"a": text, "b": text.replace("print 'done'", "print 'ready', 1")}) == [("a", "b")]


def test_shares_are_of_each_ones_own_code():
    both = SOLUTIONS["wave"] + "\n" + SOLUTIONS["rotate_gripper"]
    (pair,) = alike.pairs({"long": [both], "short": [SOLUTIONS["wave"]]}, [])
    assert (pair.first, pair.second) == ("long", "short")
    assert pair.of_second > 0.9 > pair.of_first > 0.2


def test_winnowing_keeps_any_long_common_passage():
    """Schleimer et al.: each WINDOW of consecutive hashes leaves at least one, the same in both programs."""
    rng = random.Random(1)
    passage = [rng.randbytes(8) for _ in range(alike.WINDOW)]
    for _ in range(100):
        first, second = ([rng.randbytes(8) for _ in range(rng.randrange(50))] + passage
                         + [rng.randbytes(8) for _ in range(rng.randrange(50))] for _ in range(2))
        assert alike.winnow(first) & alike.winnow(second)
    hashes = [rng.randbytes(8) for _ in range(5000)]
    assert len(alike.winnow(hashes)) / 5000 == pytest.approx(2 / (alike.WINDOW + 1), abs=0.03)


def test_of_many_programs_only_the_copy_is_found():
    rng = random.Random(2)
    words = ["a%d" % k for k in range(40)]
    texts = {"s%d" % k: ["\n".join("f.%s(g.%s, h.%s)" % tuple(rng.choices(words, k=3)) for _ in range(40))]
             for k in range(150)}
    texts["copy"] = texts["s50"]
    pairs = alike.pairs(texts, [])
    assert [(pair.first, pair.second) for pair in pairs] == [("copy", "s50")]
