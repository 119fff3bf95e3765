# SPDX-License-Identifier: BSD-3-Clause
"""The linters, each as one test."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.tree

ROOT = Path(__file__).resolve().parents[2]


def lint(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}"


def test_ruff():
    lint(sys.executable, "-m", "ruff", "check", "--quiet", ROOT)


def test_catkin_lint():
    # Offline: with rosdep's database the result would depend on an earlier `rosdep update`.
    lint("catkin_lint", "--offline", "--strict", "--quiet", "-W1", ROOT / "src")
