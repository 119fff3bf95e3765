# SPDX-License-Identifier: BSD-3-Clause
"""The pairs of links that an SRDF disables: computed, and written into its text."""
import math
import subprocess
import sys
from pathlib import Path

import pytest

from motion_planning.collision_pairs import adjacent_pairs, disabled_pairs, summary
from motion_planning.model import PlanningModel
from motion_planning.srdf import DisabledPair, SrdfError, parse_srdf, with_disabled_pairs

PACKAGE = Path(__file__).resolve().parents[2]
BALL = '<collision><origin xyz="%s"/><geometry><sphere radius="%s"/></geometry></collision>'
# A column with two arms that turn about it: a long one that meets the post and a short one that does not.
URDF = """<robot name="column"><link name="base">%s</link><link name="mount"/><link name="long">%s</link>
  <link name="tip">%s</link><link name="short">%s</link><link name="post">%s</link><link name="sleeve">%s</link>
  <joint name="f" type="fixed"><parent link="base"/><child link="mount"/></joint>
  <joint name="a" type="revolute"><parent link="mount"/><child link="long"/><axis xyz="0 0 1"/>
    <limit lower="0.5" upper="3.1" effort="1" velocity="1"/></joint>
  <joint name="t" type="fixed"><parent link="long"/><child link="tip"/></joint>
  <joint name="b" type="revolute"><parent link="mount"/><child link="short"/><axis xyz="0 0 1"/>
    <limit lower="-3.1" upper="3.1" effort="1" velocity="1"/></joint>
  <joint name="p" type="fixed"><parent link="base"/><child link="post"/></joint>
  <joint name="s" type="fixed"><parent link="post"/><child link="sleeve"/></joint></robot>""" % tuple(
      BALL % ball for ball in (("0 0 0", 0.1), ("1 0 0", 0.1), ("1 0 0.3", 0.1), ("0.5 0 0", 0.1), ("1 0 0", 0.2),
                               ("1.0 0 0.1", 0.02)))
SRDF = """<?xml version="1.0"?>
<!-- of the column -->
<robot name="column">
  <group name="arm"><joint name="a"/></group>

  <!-- <disable_collisions link1="a comment" link2="of somebody"/> -->
  <disable_collisions link1="base" link2="sleeve" reason="User"/>
  <disable_collisions link1="long" link2="post" reason="Never"/>
  <group name="other"><joint name="b"/></group>
</robot>
"""


@pytest.fixture
def column():
    return PlanningModel.from_xml(URDF, SRDF)


def test_neighbours_over_links_without_a_shape(column):
    assert adjacent_pairs(column) == {("base", "long"), ("base", "short"), ("long", "short"), ("long", "tip"),
                                      ("base", "post"), ("post", "sleeve")}


def test_each_reason(column):
    found = {(pair.link1, pair.link2): pair.reason for pair in disabled_pairs(column, None, trials=500)}
    assert found[("base", "sleeve")] == "User"
    assert {pair for pair, reason in found.items() if reason == "Adjacent"} == adjacent_pairs(column)
    # The sleeve never leaves the post; the short arm reaches nothing else.
    assert {pair for pair, reason in found.items() if reason == "Never"} == {
        ("base", "tip"), ("post", "short"), ("short", "sleeve"), ("short", "tip"), ("long", "post"), ("long", "sleeve"),
        ("post", "tip"), ("sleeve", "tip")}
    assert summary([DisabledPair("a", "b", "Never"), DisabledPair("a", "c", "Adjacent")]) == (
        "2 pairs: 1 Adjacent, 1 Never")


def test_what_touches_at_rest():
    wide = PlanningModel.from_xml(URDF.replace('lower="0.5"', 'lower="-3.1"'), "")
    found = {(pair.link1, pair.link2): pair.reason for pair in disabled_pairs(wide, None, trials=500)}
    assert found["long", "post"] == found["long", "sleeve"] == "Default"


def test_what_touches_always():
    """The long arm is clear of the post at both ends of its way, and on it all the rest."""
    place = "%r %r 0" % (math.cos(0.2), math.sin(0.2))
    text = URDF.replace('lower="0.5" upper="3.1"', 'lower="0" upper="0.4"').replace(
        BALL % ("1 0 0", 0.2), BALL % (place, 2.0 * math.sin(0.098) - 0.1))
    model = PlanningModel.from_xml(text, "")
    found = {(pair.link1, pair.link2): pair.reason for pair in disabled_pairs(model, None, trials=300)}
    assert found["long", "post"] == "Always"
    found = {(pair.link1, pair.link2): pair.reason for pair in disabled_pairs(model, None, trials=300, share=1.0)}
    assert ("long", "post") not in found


def test_the_same_seed_gives_the_same_pairs(column):
    assert disabled_pairs(column, None, trials=50) == disabled_pairs(column, None, trials=50)


def test_text_keeps_everything_else(column):
    new = with_disabled_pairs(SRDF, [DisabledPair("base", "tip", "Never"), DisabledPair("long", "tip", "a&b")])
    assert new == SRDF.replace(
        '  <disable_collisions link1="base" link2="sleeve" reason="User"/>\n'
        '  <disable_collisions link1="long" link2="post" reason="Never"/>\n', "").replace(
        "</robot>", '  <disable_collisions link1="base" link2="tip" reason="Never"/>\n'
        '  <disable_collisions link1="long" link2="tip" reason="a&amp;b"/>\n</robot>')
    assert [pair.reason for pair in parse_srdf(new, column.robot).disabled] == ["Never", "a&b"]
    assert with_disabled_pairs(new, []).count("<disable_collisions link1=\"base") == 0
    for text in ("<robot name='column'/>", "<robot name='column'></robot>", "<robot name='column'>\n</robot>\n\n"):
        changed = with_disabled_pairs(text, [DisabledPair("base", "tip")])
        assert len(parse_srdf(changed, column.robot).disabled) == 1
    for root in ("<robot name='column'></robot>", "<robot name='column'/>"):
        noted = with_disabled_pairs(root + "\n<!-- by hand -->\n", [DisabledPair("base", "tip")])
        assert noted.endswith("/>\n</robot>\n<!-- by hand -->\n")
    for text in ("<sdf/>", "", "<robot"):
        with pytest.raises(SrdfError):
            with_disabled_pairs(text, [])


def run(*arguments):
    done = subprocess.run([sys.executable, str(PACKAGE / "scripts/collisions_updater"), *map(str, arguments)],
                          capture_output=True, text=True, timeout=300)
    return done.returncode, done.stdout, done.stderr


def test_the_command(tmp_path, column):
    urdf, srdf = tmp_path / "column.urdf", tmp_path / "column.srdf"
    urdf.write_text(URDF)
    srdf.write_text(SRDF)
    status, out, err = run("--urdf", urdf, "--srdf", srdf, "--trials", 50, "--lines")
    assert status == 0 and '<disable_collisions link1="base" link2="long" reason="Adjacent"/>' in out
    assert srdf.read_text() == SRDF and "Adjacent" in err
    assert run("--urdf", urdf, "--srdf", srdf, "--trials", 50)[0] == 0
    assert len(parse_srdf(srdf.read_text(), column.robot).disabled) == len(out.splitlines())
    status, _, err = run("--urdf", tmp_path / "none.urdf", "--srdf", srdf)
    assert status == 1 and err.startswith("collisions_updater: ") and len(err.splitlines()) == 1
    status, _, err = run("--urdf", urdf, "--srdf", srdf, "--trials", 0)
    assert status == 2 and "argument --trials" in err
