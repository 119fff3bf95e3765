# SPDX-License-Identifier: BSD-3-Clause
"""Compiled code is kept between runs, as long as its sources do not change."""
import os
import shutil
import subprocess
import sys

import pytest

import arm_kinematics
import command_line
import disk_cache
import urdf_model

# A kernel that calls some of other files; how far its tip is from the base; how often it came from the cache.
_POSE_ERROR = """
import numpy as np
from arm_kinematics import kernels
print(kernels.__file__)
print(kernels.pose_error._cache.cache_path)
q = np.array([3.0])
arm = (np.array([np.eye(3)] * 2), np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), np.array([True]))
print(kernels.pose_error(arm, (np.eye(3), np.zeros(3), 6, np.eye(3)), q)[0])
print(sum(kernels.pose_error.stats.cache_hits.values()))
"""


def source_of(module):
    """A package's folder; in a devel space, catkin puts a relay package in front of it."""
    return max(module.__path__, key=lambda folder: len(os.listdir(folder)))


@pytest.fixture
def copy(tmp_path):
    """A copy of the package that may be changed; run(code) -> the lines that it prints."""
    site = tmp_path / "site"
    package = site / "arm_kinematics"
    for module in (arm_kinematics, command_line, disk_cache, urdf_model):
        shutil.copytree(source_of(module), site / module.__name__, ignore=shutil.ignore_patterns("__pycache__"))

    def run(code=_POSE_ERROR, **environment):
        # Python's own cache of byte code looks at times and lengths alone.
        plain = {"HOME": str(tmp_path), "PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run([sys.executable, "-c", code], env={**plain, **environment}, capture_output=True,
                              text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        lines = done.stdout.splitlines()
        assert lines[0].startswith(str(site))
        return lines[1:]

    run.package = package
    return run


def test_change_of_a_called_kernel_compiles_the_callers_again(copy):
    """numba itself looks at the caller's file alone."""
    _, error, hits = copy()
    assert (float(error), int(hits)) == (pytest.approx(13.0 ** 0.5), 0)
    first, error, hits = copy()
    assert (float(error), int(hits)) == (pytest.approx(13.0 ** 0.5), 1)
    linear = copy.package / "kernels" / "linear.py"
    state, text = os.stat(linear), linear.read_text()
    assert text.count("return math.sqrt(total)") == 2
    # The same length and the same time of change, as a checkout may leave it.
    linear.write_text(text.replace("return math.sqrt(total)", "return math.fabs(total)"))
    os.utime(linear, ns=(state.st_atime_ns, state.st_mtime_ns))
    second, error, hits = copy()
    assert second != first
    assert (float(error), int(hits)) == (pytest.approx(13.0), 0)


def test_kernels_find_a_cache_when_neither_source_nor_home_can_be_written(copy, tmp_path):
    """As in an installed package of a user without a home directory."""
    (copy.package / "kernels" / "__pycache__").write_text("a file is in the way of the cache")
    (tmp_path / "home").write_text("so is this")
    (tmp_path / "tmp").mkdir()
    code = ("from arm_kinematics import kernels; print(kernels.__file__); "
            "print(kernels.tip_and_jacobian._cache.cache_path)")
    cache, = copy(code, HOME=str(tmp_path / "home"), TMPDIR=str(tmp_path / "tmp"))
    assert cache.startswith(str(tmp_path / "tmp" / ("arm_kinematics_%d" % os.getuid())))
    # A cache that cannot be written counts as none.
    cache, = copy(code, HOME=str(tmp_path), NUMBA_CACHE_DIR=str(tmp_path / "home" / "cache"))
    assert cache.startswith(str(tmp_path / ".cache" / "numba" / "arm_kinematics-"))


def test_the_compiler_is_loaded_with_the_first_use():
    code = ("import sys, arm_kinematics as k; before = 'numba' in sys.modules; k.kernels.wrench; "
            "print(before, 'numba' in sys.modules)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False True\n"
    with pytest.raises(AttributeError, match="no_kernel"):
        _ = arm_kinematics.kernels.no_kernel
