# SPDX-License-Identifier: BSD-3-Clause
"""Messages about the package.xml of a user's own packages, before a command of ROS fails by them."""

import os
import subprocess

import pytest
from workspace_tree import ROOT

import own_manifests

MANIFEST = """<package format="3"><name>%s</name><version>1.0.0</version><description>test</description>
<maintainer email="a@b.example">a</maintainer><license>BSD-3-Clause</license></package>"""


@pytest.fixture
def root(tmp_path):
    for place, name in (("baxter/lab_one", "lab_one"), ("overlay/lab_one", "lab_one"), ("mine", "mine")):
        (tmp_path / "src" / place).mkdir(parents=True)
        (tmp_path / "src" / place / "package.xml").write_text(MANIFEST % name)
    return tmp_path


def test_packages_that_are_right_are_not_named(root):
    assert own_manifests.problems(root, ["mine"]) == []


def test_a_file_that_is_no_xml_is_named_with_its_line_and_how_to_leave_it_out(root):
    broken = root / "src/mine/package.xml"
    broken.write_text("<package>\n<name>mine</name\n</package>")
    sentence, = own_manifests.problems(root, ["mine"])
    assert "src/mine/package.xml" in sentence and "line 3" in sentence and "touch src/mine/CATKIN_IGNORE" in sentence
    (broken.parent / "CATKIN_IGNORE").touch()
    assert own_manifests.problems(root, ["mine"]) == []


@pytest.mark.parametrize(("old", "new", "told"), [
    ("<name>mine</name>", "", '"name" tag'), ("mine", "", "name must not be empty"), ("mine", "My Lab", '"My Lab"'),
    ("a@b.example", "ann", 'Invalid email "ann"'), ("1.0.0", "one", '"one"'), ("BSD-3-Clause", "", "license"),
])
def test_a_file_that_catkin_refuses_is_named_with_the_reason(root, old, new, told):
    """rosmsg, catkin_make and set-up end with a traceback by it."""
    text = MANIFEST % "mine"
    assert text.count(old) == 1
    (root / "src/mine/package.xml").write_text(text.replace(old, new))
    sentence, = own_manifests.problems(root, ["mine"])
    assert sentence.startswith("src/mine/package.xml is refused: ") and told in sentence
    assert "touch src/mine/CATKIN_IGNORE" in sentence
    (root / "src/mine/CATKIN_IGNORE").touch()
    assert own_manifests.problems(root, ["mine"]) == []


def test_links_that_lead_back_and_pipes_end(root):
    for name in ("once", "twice"):
        (root / "src/mine" / name).symlink_to(root / "src")
    (root / "src/mine/package.xml").unlink()
    os.mkfifo(root / "src/mine/package.xml")
    found = list(own_manifests.manifests(root / "src/mine"))
    assert len(found) == len({path.resolve() for path in found}) == 2


def test_a_name_that_another_package_has_is_named_with_it(root):
    (root / "src/mine/package.xml").write_text(MANIFEST % "lab_one")
    sentence, = own_manifests.problems(root, ["mine"])
    assert "src/mine" in sentence and "src/baxter/lab_one" in sentence
    for place in ("mine", "other"):
        (root / "src" / place).mkdir(exist_ok=True)
        (root / "src" / place / "package.xml").write_text(MANIFEST % "twin")
    sentence, = own_manifests.problems(root, ["mine", "other"])
    assert "src/mine" in sentence and "src/other" in sentence


def test_a_command_says_so_first_and_runs(root):
    (root / "src/mine/package.xml").write_text("<package")
    (root / "tools").symlink_to(ROOT / "tools")
    (root / ".baxter").mkdir()
    script = f"LAB_ROOT={root}; source {ROOT}/tools/environment.bash; build_own rosrun rf_lab2 wave.py && echo runs"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=60)
    assert done.stdout == "runs\n" and "src/mine/package.xml" in done.stderr
    (root / "src/mine/package.xml").write_text(MANIFEST % "mine")
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("runs\n", "")
