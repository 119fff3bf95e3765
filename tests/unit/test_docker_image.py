# SPDX-License-Identifier: BSD-3-Clause
"""docker/Dockerfile builds, and a student's first commands run inside: tests/docker/run, if this machine can run it."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.long
SKIPPED = 77
LIMIT_S = 5400


def test_the_image_builds_and_a_student_can_use_it():
    done = subprocess.run([ROOT / "tests" / "docker" / "run"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=LIMIT_S)
    if done.returncode == SKIPPED:
        pytest.skip(done.stdout.rpartition("skipped: ")[2].splitlines()[0])
    assert done.returncode == 0, done.stdout[-4000:]
