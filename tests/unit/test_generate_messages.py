# SPDX-License-Identifier: BSD-3-Clause
"""Messages generated in one process are those that catkin would generate, and faults are left to make."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import generate_messages
from generate_messages import SHEBANG, SKIP

# As CMake writes it for one message; a tab begins a command.
MAKEFILE = """\
{result}: /usr/lib/genpy/genmsg_py.py
{result}: {source}
\t@$(CMAKE_COMMAND) -E cmake_echo_color "Generating Python from MSG things/Thing"
\tcd {build}/things && {env} {python} {generator} {source} {path} -p things -o {folder}
"""
CHECK = """\
_things_generate_messages_check_deps_Thing:
\tcd {build}/things && {env} {python} /usr/lib/genmsg/genmsg_check_deps.py things {source} {needs}
"""


class Build:
    """A configured build folder of one package with one message."""

    def __init__(self, folder: Path, message: str, needs: str = ""):
        self.build, self.source = folder / "build", folder / "Thing.msg"
        self.result = folder / "devel/things/msg/_Thing.py"
        self.environment = self.build / "catkin_generated/env_cached.sh"
        self.source.write_text(message)
        self.words = {"result": self.result, "source": self.source, "build": self.build, "folder": self.result.parent,
                      "env": "../catkin_generated/env_cached.sh", "python": sys.executable,
                      "generator": "/usr/lib/genpy/genmsg_py.py", "path": "-Istd_msgs:/usr/share/std_msgs/msg",
                      "needs": needs}
        for name, text in (("py", MAKEFILE), ("check_deps_Thing", CHECK)):
            makefile = self.build / f"things/CMakeFiles/_things_generate_messages_{name}.dir/build.make"
            makefile.parent.mkdir(parents=True)
            makefile.write_text(text.format(**self.words))
        self.environment.parent.mkdir()
        self.environment.write_text(SHEBANG + 'exec "$@"\n')

    def run(self) -> str:
        script = Path(generate_messages.__file__)
        return subprocess.run([sys.executable, script, self.build], check=True, capture_output=True, text=True).stdout

    def by_catkin(self) -> str:
        """The same message as make generates it, in a separate process."""
        folder = self.build / "by_catkin"
        folder.mkdir()
        subprocess.run([sys.executable, "/usr/lib/genpy/genmsg_py.py", self.source, self.words["path"], "-p", "things",
                        "-o", folder], check=True, capture_output=True)
        return (folder / "_Thing.py").read_text()


pytestmark = pytest.mark.skipif(not Path("/usr/lib/genpy/genmsg_py.py").is_file(), reason="ROS is not Debian's")


def test_the_result_is_catkin_s(tmp_path):
    build = Build(tmp_path, "std_msgs/Header header\nfloat64[] values\n", "std_msgs/Header")
    assert build.run() == "2 of 2 message generators run\n"
    assert build.result.read_text() == build.by_catkin()
    assert build.environment.read_text() == SHEBANG + SKIP + 'exec "$@"\n'


def test_only_old_results_are_made_again(tmp_path):
    build = Build(tmp_path, "int32 a\n")
    build.run()
    assert build.run() == "1 of 1 message generators run\n"  # the check
    later = build.result.stat().st_mtime + 10.0
    os.utime(build.source, (later, later))
    assert build.run() == "2 of 2 message generators run\n"


@pytest.mark.parametrize(("message", "left"), [("int33 a\n", 2), ("std_msgs/Header header\n", 1)],
                         ids=["no such type", "a type that the package does not name"])
def test_make_repeats_what_fails(tmp_path, message, left):
    build = Build(tmp_path, message)
    assert build.run().count("left to make: ") == left
    assert build.result.exists() == (left == 1) and SKIP not in build.environment.read_text()


def test_the_build_environment_skips_checks_alone(tmp_path):
    build = Build(tmp_path, "int32 a\n")
    build.run()
    for script, printed in (("/usr/lib/genmsg/genmsg_check_deps.py", ""), ("/usr/lib/genpy/genmsg_py.py", "ran\n")):
        done = subprocess.run(["sh", build.environment, "echo", script], capture_output=True, text=True)
        assert bool(done.stdout) == bool(printed)
