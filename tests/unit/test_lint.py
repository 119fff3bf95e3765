# SPDX-License-Identifier: BSD-3-Clause
"""The linters, each as one test."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.tree

ROOT = Path(__file__).resolve().parents[2]
#: The checker of types, for the packages that pyrightconfig.json names. It has 40 MB: it is fetched when first used;
#: it runs in Debian's node, which the page's libraries need as well (npm).
PYRIGHT, PYRIGHT_FOLDER = "pyright==1.1.414", ROOT / ".baxter" / "pyright"


def lint(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}"


def test_ruff():
    lint(sys.executable, "-m", "ruff", "check", "--quiet", ROOT)


def test_catkin_lint():
    # Offline: with rosdep's database the result would depend on an earlier `rosdep update`.
    lint("catkin_lint", "--offline", "--strict", "--quiet", "-W1", ROOT / "src")


@pytest.mark.long
def test_pyright():
    if shutil.which("node") is None:
        pytest.skip("pyright needs node: apt install nodejs")
    folder = PYRIGHT_FOLDER / PYRIGHT.rpartition("=")[2]
    if not folder.exists():
        done = subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(folder),
                               PYRIGHT], capture_output=True, text=True)
        if done.returncode:
            shutil.rmtree(folder, ignore_errors=True)
            pytest.skip("pyright could not be fetched: " + done.stderr.strip().splitlines()[-1])
    lint(sys.executable, ROOT / "tools/message_stubs.py", ROOT / ".baxter/typings")
    lint("node", folder / "pyright/dist/index.js", "--project", ROOT / "pyrightconfig.json")
