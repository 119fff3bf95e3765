# SPDX-License-Identifier: BSD-3-Clause
"""The setup files of an install space that was moved find their own place, in every installed shell."""

import shutil
import subprocess
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2]
TEMPLATES = Path("/usr/share/catkin/cmake/templates")
NAMES = ("setup.sh", "local_setup.sh", "setup.bash", "local_setup.bash", "setup.zsh", "local_setup.zsh")
SHELLS = ["sh", "dash", "bash", "zsh", "mksh", "busybox sh"]


@pytest.fixture
def moved(tmp_path):
    """An install space as catkin and this package make it, in another folder than the one it was made for."""
    made, moved = tmp_path / "made", tmp_path / "moved here"
    made.mkdir()
    for name in NAMES:
        text = (TEMPLATES / f"{name}.in").read_text()
        (made / name).write_text(text.replace("@SETUP_DIR@", str(made)).replace("@SETUP_FILENAME@", "setup"))
    (made / "_setup_util.py").write_text(f"#!{made}/gone/python\n")
    command = ["cmake", f"-DCMAKE_INSTALL_PREFIX={made}", "-P", PACKAGE / "cmake" / "own_place.cmake"]
    for _ in range(2):  # an install over an earlier one changes nothing
        subprocess.run(command, check=True)
    assert (made / "_setup_util.py").read_text() == "#!/usr/bin/python3\n"
    assert (made / "setup.sh").read_text().count("BASH_SOURCE") == 1
    # Prints, instead of the environment, where it lies; setup.sh sources the output.
    (made / "_setup_util.py").write_text('#!/bin/sh\necho "SEEN=\'${0%/*}\'; _CATKIN_ENVIRONMENT_HOOKS_COUNT=0"\n')
    (made / "_setup_util.py").chmod(0o755)
    made.rename(moved)
    return moved


def seen(shell, script, folder):
    done = subprocess.run([*shell.split(), "-c", script + '\necho "$SEEN"'], cwd=folder, capture_output=True, text=True,
                          env={"PATH": "/usr/bin:/bin"})
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize("name", ["setup.sh", "local_setup.sh"])
def test_sh(moved, tmp_path, shell, name):
    if shutil.which(shell.split()[0]) is None:
        pytest.skip(f"no {shell} here")
    assert seen(shell, f'. "{moved}/{name}"', "/") == str(moved)
    assert seen(shell, f". ./{name}", moved) == str(moved)
    # From another file of the same name, as a chained workspace's is.
    (tmp_path / "setup.sh").write_text(f'. "{moved}/{name}"\n')
    assert seen(shell, f'. "{tmp_path}/setup.sh"', "/") == str(moved)
    assert seen(shell, f'value=$(. "{moved}/{name}"; echo "$SEEN"); SEEN=$value', "/") == str(moved)
    assert seen(shell, f'_CATKIN_SETUP_DIR="{moved}"; . "{moved}/{name}"', "/") == str(moved)


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_bash_and_zsh(moved, shell):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} here")
    for name in (f"setup.{shell}", f"local_setup.{shell}"):
        assert seen(shell, f'. "{moved}/{name}"', "/") == str(moved)
