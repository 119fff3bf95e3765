# SPDX-License-Identifier: BSD-3-Clause
"""A student's own package as in the lab sheet, in a shell that was open before the package was created.

Runs in a scratch workspace that has copies of the environment's packages and uses this workspace's virtual environment.
"""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

NODE = """#!/usr/bin/env python
import sys
import pybullet
import rospy
print("node on", sys.prefix)
"""
TEST_NODE = """#!/usr/bin/env python3
import sys, unittest
import rostest

class WhichPython(unittest.TestCase):
    def test_prefix(self):
        self.assertTrue(sys.prefix.endswith(".venv"), sys.prefix)

rostest.rosrun("foo", "which_python", WhichPython)
"""
LAUNCH = '<launch><test test-name="which_python" pkg="foo" type="which_python.py"/></launch>'


def run(script, cwd, shell="bash", **variables):
    """Run a script in a fresh shell whose PATH starts with another Python, as pyenv's and conda's users have it."""
    decoy = cwd / "decoy"
    decoy.mkdir(exist_ok=True)
    for name in ("python", "python3"):
        (decoy / name).write_text("#!/bin/sh\necho the wrong python >&2; exit 9\n")
        (decoy / name).chmod(0o755)
    environment = {"PATH": f"{decoy}:/usr/bin:/bin", "HOME": str(cwd), "LANG": "C.UTF-8", **variables}
    done = subprocess.run(
        [shell, "-c", script], cwd=cwd, env=environment, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    folder = tmp_path_factory.mktemp("student")
    for name in ("command_line", "lab_environment", "master_calls", "rospy_fixes"):
        shutil.copytree(ROOT / "src/base" / name, folder / "src/base" / name)
    (folder / "tools").mkdir()
    for name in ("tools/setup.bash", "tools/apt_packages.txt", "requirements.txt"):
        (folder / name).touch()
    (folder / ".venv").symlink_to(ROOT / ".venv")
    configure = f"catkin_make -DPYTHON_EXECUTABLE={folder}/.venv/bin/python3"
    session = f"""
        set -e
        {configure} >first_build.txt 2>&1 || {{ cat first_build.txt; exit 1; }}
        source devel/setup.bash
        cd src
        catkin_create_pkg foo rospy
        mkdir -p foo/scripts foo/test
        cat >foo/scripts/node.py <<'END'\n{NODE}END
        cat >foo/test/which_python.py <<'END'\n{TEST_NODE}END
        echo '{LAUNCH}' >foo/test/which_python.test
        chmod +x foo/scripts/node.py foo/test/which_python.py
        cd ..
        catkin_make
        rosrun foo node.py >node.txt
        (rostest foo which_python.test || echo "exit code $?") >rostest.txt 2>&1
    """
    run(session, folder, ROS_TEST_RESULTS_DIR=str(folder / "results"), ROS_LOG_DIR=str(folder / "log"))
    return folder


def test_new_package_runs_in_the_open_shell(workspace):
    assert (workspace / "node.txt").read_text() == f"node on {workspace}/.venv\n"


def test_rostest_runs_on_its_own_under_our_python(workspace):
    output = (workspace / "rostest.txt").read_text()
    assert "exit code" not in output, output
    assert "* TESTS: 1" in output and "* FAILURES: 0" in output, output


@pytest.mark.parametrize("shell", ["bash", "sh", "zsh"])
def test_setup_file_is_sufficient_and_idempotent(workspace, shell):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    setup = f"{workspace}/devel/setup.{shell}"
    variables = 'echo "$PATH|$ROS_MASTER_URI|$ROS_HOSTNAME|$(command -v python)"'
    once, twice = run(f". {setup} && {variables} && . {setup} && {variables}", workspace, shell).splitlines()
    path, master, hostname, python = once.split("|")
    assert once == twice
    assert path.split(":")[0] == f"{workspace}/.venv/bin" and path.count("/.venv/bin") == 1
    assert (master, hostname) == ("http://localhost:11311", "localhost")
    assert python == f"{workspace}/.venv/bin/python"


def test_hook_keeps_what_the_user_set(workspace):
    script = '. devel/setup.sh && echo "$ROS_MASTER_URI|${ROS_HOSTNAME-unset}|${ROS_IP-unset}"'
    robot = run(script, workspace, "sh", ROS_MASTER_URI="http://baxter.local:11311", ROS_IP="10.42.0.1")
    assert robot == "http://baxter.local:11311|unset|10.42.0.1\n"
    assert run(script, workspace, "sh", ROS_HOSTNAME="desk.local") == "http://localhost:11311|desk.local|unset\n"


def test_catkin_make_does_not_wait_for_a_quiet_machine(workspace):
    jobs = run('. devel/setup.sh && echo "$ROS_PARALLEL_JOBS"', workspace, "sh").strip()
    assert jobs.startswith("-j") and "-l" not in jobs
    assert run('. devel/setup.sh && echo "$ROS_PARALLEL_JOBS"', workspace, "sh", ROS_PARALLEL_JOBS="-j1") == "-j1\n"


def test_messages_in_lisp_are_built_on_request_only(workspace):
    assert run('. devel/setup.sh && echo "$ROS_LANG_DISABLE"', workspace, "sh") == "genlisp\n"
    assert run('. devel/setup.sh && echo "$ROS_LANG_DISABLE"', workspace, "sh", ROS_LANG_DISABLE="") == "\n"


def test_bash_has_the_rosbash_functions(workspace):
    script = "source devel/setup.bash && roscd foo && pwd && complete -p rosrun"
    assert run(script, workspace).startswith(f"{workspace}/src/foo\n")


PACKAGE = """<package format="2"><name>{0}</name><version>0.1.0</version><description>Mine.</description>
<maintainer email="me@example.org">me</maintainer><license>BSD</license><buildtool_depend>catkin</buildtool_depend>
<depend>{1}</depend></package>"""


def catkin_make_leaves_the_lab_alone(workspace):
    """The lab's catkin_make in the workspace: what it builds itself, and what it leaves to catkin's own."""
    for name in ("catkin_make", "environment.bash", "own_manifests.py", "own_packages.py"):
        shutil.copy(ROOT / "tools" / name, workspace / "tools" / name)
    state = workspace / ".baxter"
    (state / "build.stamp").touch()
    catkins_own = workspace / "catkins_own" / "catkin_make"
    catkins_own.parent.mkdir()
    catkins_own.write_text('#!/bin/sh\necho catkins own: "$*"\n')
    catkins_own.chmod(0o755)
    before = (f"source devel/setup.bash; PATH={catkins_own.parent}:$PATH LAB_ROOT={workspace}; "
              "source tools/environment.bash; fingerprint >.baxter/done; ")

    def said(command):
        return run(f"{before}{command} 2>&1", workspace)

    everything = said("tools/catkin_make -j1")
    assert "building mine_msgs" in everything and "building mine_a" in everything and "catkins own" not in everything
    assert everything.count("Configuring done") == 1, "only foo has not been built before"
    assert (state / "own_done").read_text() == said("own_fingerprint")
    (workspace / "src/mine_msgs/msg/Bar.msg").write_text("float64 x\nfloat64 y\n")
    one = said("tools/catkin_make --pkg mine_msgs")
    assert "building mine_msgs" in one and "mine_a" not in one
    for words in ("-DX=1", "--pkg lab_environment", "install", "--pkg mine_a install --force-cmake"):
        assert said(f"tools/catkin_make {words}") == f"catkins own: {words}\n"
    assert said("cd src && ../tools/catkin_make") == "catkins own: \n"
    package = workspace / "src/base/lab_environment"
    changed = package / "new.cpp"
    changed.touch()
    assert said("tools/catkin_make") == "catkins own: \n"
    changed.unlink()
    changed = package / "env-hooks" / "new"
    assert said(f"touch {changed}; tools/catkin_make") == "catkins own: \n"
    changed.unlink()


def test_own_packages_are_built_alone_in_their_order(workspace):
    """mine_a needs the messages of mine_msgs; a second run has nothing to do, and a broken one is named."""
    messages = "\nadd_message_files(FILES Bar.msg)\ngenerate_messages()"
    for name, needs, more in (("mine_a", "mine_msgs", ""), ("mine_msgs", "message_generation", messages)):
        folder = workspace / "src" / name
        folder.mkdir()
        (folder / "package.xml").write_text(PACKAGE.format(name, needs))
        (folder / "CMakeLists.txt").write_text(
            f"cmake_minimum_required(VERSION 3.5)\nproject({name})\nfind_package(catkin REQUIRED COMPONENTS {needs})"
            f"{more}\ncatkin_package()\n")
    (workspace / "src/mine_msgs/msg").mkdir()
    (workspace / "src/mine_msgs/msg/Bar.msg").write_text("float64 x\n")
    space = {file: file.read_bytes() for file in (workspace / "devel").iterdir() if file.is_file()}
    tool = f"/usr/bin/python3 {ROOT}/tools/own_packages.py {workspace} mine_a mine_msgs"
    build = f"source devel/setup.bash && {tool} 2>&1"
    assert run(build, workspace).splitlines() == ["building mine_msgs …", "building mine_a …"]
    assert run(build, workspace) == ""
    assert {file: file.read_bytes() for file in space} == space
    use = "source devel/setup.bash && python3 -c 'from mine_msgs.msg import Bar; print(Bar(x=2.0))'"
    assert run(use, workspace) == "x: 2.0\n"
    catkin_make_leaves_the_lab_alone(workspace)
    (workspace / "src/mine_a/CMakeLists.txt").write_text("nonsense(\n")
    said = run(f"source devel/setup.bash; {tool} 2>&1; echo $?", workspace)
    assert "the package mine_a does not build" in said and said.endswith("\n1\n") and "own-mine_a.log" in said
    for name in ("mine_a", "mine_msgs"):
        shutil.rmtree(workspace / "src" / name)


def test_install_space_works_too(workspace):
    run("source devel/setup.bash && catkin_make install", workspace)
    imports = "python3 -c 'import rospy, pybullet'"
    script = f"source install/setup.bash && command -v python3 && {imports} && rospack find foo"
    python, package = run(script, workspace).splitlines()[-2:]
    assert python == f"{workspace}/.venv/bin/python3"
    assert package == f"{workspace}/install/share/foo"
