# SPDX-License-Identifier: BSD-3-Clause
"""Set-up that is killed, interrupted or out of disk at any of its steps: its messages, and the next run repairs it.

The commands of the steps are fakes here, which can hang half-way or fail; test_setup_for_real.py has the real ones.
"""

import contextlib
import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from lab_doctor.probe import last_failure
from lab_testing.processes import living
from lab_testing.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 60
# The command that hangs or fails, step by step, as a pattern of the shell's. A step's half work is a file named half*.
COMMANDS = {
    "apt": "apt-get install*",
    "venv": "python3 -m venv*",
    "overlay": "vcs import*",
    "pip": "python3 -m pip install*",
    "meshes": "cp -r*",
    "build": "catkin_make*",
    "urdf": "rosrun xacro*",
    "kernels": "python3 -m arm_kinematics*",
}
TITLES = {
    "apt": "Debian packages", "venv": "virtual environment", "pip": "Python packages", "meshes": "Baxter's meshes",
    "overlay": "other people's packages", "build": "catkin_make", "urdf": "baxter.urdf",
    "kernels": "compiled inner loops",
}
STAND_IN = r"""#!/bin/bash
here=${0%/*} root=$LAB_ROOT venv=$LAB_ROOT/.venv
line="${0##*/} $*"
site=$venv/lib/python3.11/site-packages
data=$site/cmeel.prefix/share/example-robot-data/robots/baxter_description/meshes
half_work() {
    case $line in
        "apt-get install"*) touch "$root/half_unpacked" ;;
        "python3 -m venv"*) whole_work; touch "$site/half" ;;
        "python3 -m pip install"*) touch "$site/half" ;;
        "cp -r"*) mkdir -p "${!#}/torso"; touch "${!#}/torso/half" ;;
        "vcs import"*) mkdir -p "$root/src_overlay/sdk/.git"; touch "$root/src_overlay/sdk/half" ;;
        "catkin_make"*) whole_work; touch "$root/build/half.o" ;;
        "rosrun xacro"*) echo half ;;
    esac
}
whole_work() {
    case $line in
        "apt-get"*)
            # As the real one does after dpkg was killed.
            if [[ -e $root/half_unpacked ]]; then
                echo "E: dpkg was interrupted, you must manually run 'dpkg --configure -a' to correct the problem." >&2
                exit 100
            fi
            ;;
        "dpkg --configure -a") rm -f "$root/half_unpacked" ;;
        "python3 -m venv"*)
            rm -rf "$venv"
            mkdir -p "$venv/bin" "$site"
            echo "include-system-site-packages = true" >"$venv/pyvenv.cfg"
            echo "#!$venv/bin/python3" >"$venv/bin/pip"
            chmod +x "$venv/bin/pip"
            printf '#!/bin/sh\nexec %s/python3 "$@"\n' "$here" >"$venv/bin/python3"
            chmod +x "$venv/bin/python3"
            ;;
        "python3 -m pip install"*)
            mkdir -p "$data/torso" "$data/electric_gripper"
            touch "$data/torso/a.dae" "$data/electric_gripper/b.dae"
            ;;
        "cp "*) exec /bin/cp "${@}" ;;
        "vcs import"*) mkdir -p "$root/src_overlay/sdk/.git"; touch "$root/src_overlay/sdk/.git/index" ;;
        "catkin_make"*)
            mkdir -p "$root/build" "$root/devel"
            echo "CMAKE_HOME_DIRECTORY:INTERNAL=$root/src" >"$root/build/CMakeCache.txt"
            touch "$root/devel/setup.bash"
            ;;
        "rosrun xacro"*) echo whole ;;
    esac
}
if [[ $line == $(cat "$here/hang" 2>/dev/null) ]]; then
    half_work
    # Not a child process: bash continues if an interrupt hits a command that ends with success.
    : >"$here/hanging"
    exec sleep 300
fi
if [[ $line == $(cat "$here/fail" 2>/dev/null) ]]; then
    cat "$here/words" >&2
    # A command that ended by itself has removed its partial results; on a full disk it stopped half-way.
    if grep -q "No space left" "$here/words"; then half_work; fi
    exit 9
fi
whole_work "$@"
"""


@pytest.fixture
def workspace(tmp_path):
    """(folder of a workspace with the files that set-up reads, folder of the fake commands)."""
    root, fakes = tmp_path / "ws", tmp_path / "fakes"
    for folder in ("src/baxter/baxter_common/baxter_description/urdf", "src/courses/cwru_baxter_sim",
                   "src/baxter/baxter_common/rethink_ee_description", "src/base/xacro"):
        (root / folder).mkdir(parents=True)
    (root / "src/baxter/baxter_common/baxter_description/urdf/baxter.urdf.xacro").write_text("<robot/>")
    (root / "src/courses/cwru_baxter_sim/cwru_baxter.urdf.xacro").write_text("<robot/>")
    subprocess.run(["cp", "-r", *(ROOT / name for name in ("baxter.sh", "tools")), root], check=True)
    for name in ("requirements.txt", "requirements-nodeps.txt"):
        (root / name).write_text("something==1\n")
    (root / "tools" / "apt_packages.txt").write_text("no-such-package\n")
    (root / "theirs.rosinstall").write_text("")
    fakes.mkdir()
    for name in ("apt-get", "dpkg", "python3", "cp", "vcs", "catkin_make", "rosrun"):
        (fakes / name).write_text(STAND_IN)
        (fakes / name).chmod(0o755)
    (fakes / "sudo").write_text('#!/bin/bash\n[[ $1 == -v ]] || exec "$@"\n')
    (fakes / "sudo").chmod(0o755)
    # A machine with a name server, and with as much free disk as the file says.
    (fakes / "getent").write_text("#!/bin/sh\n")
    (fakes / "getent").chmod(0o755)
    (fakes / "free").write_text("100000000")
    (fakes / "df").write_text('#!/bin/sh\necho header\necho /dev/disk 1 1 "$(cat "${0%/*}/free")" 1% /\n')
    (fakes / "df").chmod(0o755)
    setup = (root / "tools" / "setup.bash").read_text()
    setup = setup.replace("export PATH=", f"export PATH={fakes}:").replace("/usr/bin/python3", f"{fakes}/python3")
    (root / "tools" / "setup.bash").write_text(setup)
    return root, fakes


def start(root):
    command = [root / "baxter.sh", "setup", "--with", "theirs.rosinstall"]
    return subprocess.Popen(command, cwd=root, text=True, start_new_session=True, stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def finish(process):
    """(exit status, output)"""
    try:
        said, _ = process.communicate(timeout=LIMIT_S)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    return process.returncode, said


def wait_for(path, process):
    wait_until(lambda: path.exists() or process.poll() is not None, f"set-up to make {path}", LIMIT_S)
    assert path.exists(), f"set-up ended before it made {path}: {process.communicate()[0]}"


def assert_whole(root):
    """No half-written file is left, and everything exists."""
    assert list(root.rglob("half*")) == []
    description = root / "src/baxter/baxter_common/baxter_description"
    assert (description / "meshes/torso/a.dae").exists()
    assert (description / "urdf/baxter.urdf").read_text() == "whole\n"
    for name in ("devel/setup.bash", "build/CMakeCache.txt", "src_overlay/sdk/.git/index", ".baxter/done"):
        assert (root / name).exists(), name
    assert not (root / ".baxter/at_work").exists()


def kill_session(leader):
    """Kill a process and all that it has started, as a machine that is switched off does."""
    def are_gone():
        found = session(leader)
        for pid in found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        return not found

    # More than once: what a process starts while the others are looked at and killed is not among them.
    wait_until(are_gone, "the end of a killed set-up", LIMIT_S)


def session(leader):
    """Living processes of a session."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, _, _, its_session = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
            if int(its_session) == leader and state not in "ZX":
                found.append(int(folder.name))
    return found


def steps(*often):
    """All steps; what is tested of others than ``often`` takes long in all."""
    return [pytest.param(step, marks=[] if step in often else [pytest.mark.long]) for step in COMMANDS]


@pytest.mark.parametrize("step", steps("apt", "pip", "build"))
def test_killed_and_run_again(workspace, step):
    root, fakes = workspace
    (fakes / "hang").write_text(COMMANDS[step])
    process = start(root)
    wait_for(fakes / "hanging", process)
    # The first configuration runs beside earlier steps.
    wait_until(lambda: (root / ".baxter/at_work").read_text().strip() == step, "set-up to be at step " + step, LIMIT_S)
    kill_session(process.pid)
    finish(process)
    (fakes / "hang").unlink()
    status, said = finish(start(root))
    assert status == 0, said
    assert f"cut off in step '{TITLES[step]}'" in said
    assert_whole(root)  # also that no step counts as cut off any more


@pytest.mark.parametrize("step", steps("venv", "meshes", "kernels"))
def test_a_failure_names_step_cause_command_and_log(workspace, step):
    root, fakes = workspace
    (fakes / "fail").write_text(COMMANDS[step])
    (fakes / "words").write_text("something about a Temporary failure in name resolution\n")
    status, said = finish(start(root))
    assert status != 0
    assert f"failed in step '{TITLES[step]}'" in said
    assert "cause:   the network cannot be reached" in said and "Temporary failure in name resolution" in said
    assert f"log:     {root}/.baxter/logs/{step}.log" in said
    failure = last_failure(root)
    assert failure.step == step and "Temporary failure" in failure.cause
    (fakes / "fail").unlink()
    status, said = finish(start(root))
    assert status == 0 and "cut off" not in said, said
    assert last_failure(root) is None
    assert_whole(root)


def test_relays_to_scripts_that_are_gone_are_removed(workspace):
    root, _ = workspace
    (root / "devel/bin").mkdir(parents=True)
    (root / "script").write_text("")
    for name, script in (("gone", "nowhere"), ("living", "script")):
        (root / "devel/bin" / name).write_text(f"#!/usr/bin/env python3\npython_script = '{root}/{script}'\n")
    (root / "devel/bin/other").write_text("no relay\n")
    status, said = finish(start(root))
    assert status == 0, said
    assert sorted(path.name for path in (root / "devel/bin").iterdir()) == ["living", "other"]


def test_the_command_xacro_follows_ours_to_another_folder(workspace):
    root, _ = workspace
    ours, command = root / "src/base/xacro/xacro", root / ".venv/bin/xacro"
    ours.write_text("ours")
    assert finish(start(root))[0] == 0
    command.unlink()
    command.symlink_to("../../src/elsewhere/xacro")
    status, said = finish(start(root))
    assert status == 0 and command.read_text() == "ours", said


def test_a_step_that_refuses_to_start_is_not_cut_off(workspace):
    root, fakes = workspace
    (fakes / "free").write_text("1000")
    status, said = finish(start(root))
    assert status == 1 and "cannot continue in step 'Debian packages': too little disk" in said
    (fakes / "free").write_text("100000000")
    status, said = finish(start(root))
    assert status == 0 and "cut off" not in said, said


def test_a_list_of_packages_that_is_not_there_is_told_before_the_first_step(workspace):
    root, _ = workspace
    (root / "theirs.rosinstall").unlink()
    status, said = finish(start(root))
    assert status == 2 and f"there is no file {root}/theirs.rosinstall" in said and "[1/" not in said


@pytest.mark.parametrize("step", ["pip", "build"])
def test_without_a_terminal_a_long_step_says_what_it_does(workspace, step):
    root, fakes = workspace
    script = root / "tools/setup_run.bash"
    assert "\nLIFE_S=60\n" in script.read_text()
    script.write_text(script.read_text().replace("\nLIFE_S=60\n", "\nLIFE_S=1\n"))
    half = 'mkdir "$site/"{a-1,b-2}.dist-info; echo Installing collected packages: a, b, c'
    stand_in = (fakes / "python3").read_text()
    (fakes / "python3").write_text(stand_in.replace('install"*) touch "$site/half"', f'install"*) {half}'))
    (fakes / "hang").write_text(COMMANDS[step])
    process = start(root)
    wait_for(fakes / "hanging", process)
    line = ""
    while not (told := re.fullmatch(r"  +\d+ s: (.+)\n", line)):
        line = process.stdout.readline()
        assert line, "set-up ended without a word about the step"
    os.killpg(process.pid, signal.SIGINT)
    finish(process)
    assert step != "pip" or re.match(r"2 packages are there, the last one [ab]-\d", told[1])
    wait_until(lambda: not living(process.pid), "all processes of set-up to end", LIMIT_S)


# The cause is read from the log, in the same way for each step.
@pytest.mark.parametrize("step", ["venv", "meshes", "build"])
def test_a_full_disk_counts_as_cut_off(workspace, step):
    root, fakes = workspace
    (fakes / "fail").write_text(COMMANDS[step])
    (fakes / "words").write_text("fatal error: writing: No space left on device\n")
    status, said = finish(start(root))
    assert status == 9 and "cause:   the disk is full" in said, said
    assert f"failed in step '{TITLES[step]}'" in said and f"log:     {root}/.baxter/logs/{step}.log" in said
    (fakes / "fail").unlink()
    status, said = finish(start(root))
    assert status == 0 and f"cut off in step '{TITLES[step]}'" in said, said
    assert_whole(root)


def test_an_interrupt_says_where_and_leaves_nothing_running(workspace):
    root, fakes = workspace
    (fakes / "hang").write_text(COMMANDS["pip"])
    process = start(root)
    wait_for(fakes / "hanging", process)
    os.killpg(process.pid, signal.SIGINT)
    status, said = finish(process)
    assert status == 130
    assert "interrupted in step 'Python packages'" in said and f"{root}/.baxter/logs/pip.log" in said
    wait_until(lambda: not living(process.pid), lambda: f"the end of {living(process.pid)}", LIMIT_S)


def test_what_outlives_a_killed_set_up_is_waited_for(workspace):
    root, fakes = workspace
    (fakes / "hang").write_text(COMMANDS["pip"])
    first = start(root)
    wait_for(fakes / "hanging", first)
    first.kill()  # set-up alone; pip goes on
    first.wait()
    (fakes / "hang").unlink()
    second = start(root)
    told = second.stdout.readline()
    assert "another set-up is running" in told and f"step 4 of 9 ({TITLES['pip']}) since " in told
    assert list(root.rglob("site-packages/half"))
    os.killpg(first.pid, signal.SIGKILL)
    status, said = finish(second)
    assert status == 0, said
    assert_whole(root)


def test_too_little_disk_is_told_before_anything_is_fetched(workspace):
    root, fakes = workspace
    (fakes / "free").write_text("3900")
    status, said = finish(start(root))
    assert status == 1 and "too little disk: / has 3900 MB free" in said and "4800 MB" in said
    assert "too little disk" in last_failure(root).cause
    assert "apt-get" not in (root / ".baxter/logs/apt.log").read_text()
    # The rest of a set-up that has begun needs less.
    (root / ".venv").mkdir()
    status, said = finish(start(root))
    assert status == 0 and "cut off" not in said, said


@pytest.mark.parametrize(("source", "answers", "told"), [
    ("deb http://archive.example/debian trixie main", False, "archive.example"),
    ("Types: deb\nURIs: https://archive.example:8000/debian\n# URIs: http://other.example/", False, "archive.example"),
    ("deb http://archive.example/debian trixie main", True, ""),
    ("deb [trusted=yes] file:/srv/packages ./\ndeb http://archive.example/debian trixie main", False, ""),
], ids=["no address", "deb822", "an address", "a folder beside it"])
def test_no_network_is_told_before_apt_waits_for_it(tmp_path, source, answers, told):
    (tmp_path / "a.list").write_text(source + "\n")
    (tmp_path / "getent").write_text(f"#!/bin/sh\nexit {0 if answers else 2}\n")
    (tmp_path / "getent").chmod(0o755)
    script = 'source "$1/tools/platform.bash"; unreachable_archive "$2"'
    for variables, expected in (({}, told), ({"http_proxy": "http://proxy.example:3128"}, "")):
        environment = {"PATH": f"{tmp_path}:/usr/bin:/bin", "APT_CONFIG": "/dev/null", **variables}
        command = ["bash", "-uc", script, "test", ROOT, tmp_path / "a.list"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        assert (expected in done.stdout) and bool(done.stdout) == bool(expected), done.stdout


def test_what_was_set_up_on_another_system_is_made_again(workspace):
    root, _ = workspace
    assert finish(start(root))[0] == 0
    here = (root / ".baxter/system").read_text()
    (root / ".baxter/system").write_text("another system\n")
    (root / "build" / "half.o").touch()
    (root / ".venv/lib/python3.11/site-packages/half").touch()
    status, said = finish(start(root))
    assert status == 0 and "another system" in said, said
    assert_whole(root)
    assert (root / ".baxter/system").read_text() == here


def test_a_state_that_could_not_be_written_is_taken_for_the_worst(workspace):
    root, _ = workspace
    assert finish(start(root))[0] == 0
    (root / "build" / "half.o").touch()
    (root / ".venv/lib/python3.11/site-packages/half").touch()
    (root / ".baxter/at_work").write_text("")
    status, said = finish(start(root))
    assert status == 0 and "cut off in step 'unknown'" in said, said
    assert_whole(root)


def test_an_optional_package_is_asked_for_where_the_system_has_it(workspace):
    root, fakes = workspace
    (root / "tools" / "apt_packages.txt").write_text("no-such-package\nhad-package optional\nabsent-package optional\n")
    (fakes / "apt-cache").write_text('#!/bin/sh\n[ "$2" = had-package ]\n')
    (fakes / "apt-cache").chmod(0o755)
    assert finish(start(root))[0] == 0
    asked = (root / ".baxter/logs/apt.log").read_text()
    assert "recommends had-package no-such-package\n" in asked and "absent-package" not in asked


SAYINGS = [
    (1, "ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device", "the disk is full"),
    (100, "E: You don't have enough free space in /var/cache/apt/archives/.", "the disk is full"),
    (100, "Err:1 http://archive.example\n  Temporary failure resolving 'archive.example'",
     "the network cannot be reached"),
    (1, "NewConnectionError('Failed to establish a new connection: [Errno -2]", "the network cannot be reached"),
    (1, "SSLError(SSLCertVerificationError(1, '[SSL: CERTIFICATE_VERIFY_FAILED]", "a certificate that is not trusted"),
    (100, "E: Unable to locate package ros-desktop", "a package is missing in the system's sources"),
    (1, "cannot create directory 'build': Permission denied", "no permission to write files"),
    (1, "/usr/bin/ld: cannot find -lEGL: No such file or directory", "a Python package is compiled here"),
    (1, "glcontext/headless.cpp:3:10: fatal error: EGL/egl.h: No such file", "a Python package is compiled here"),
    (137, "c++: fatal error", "it was killed"),
    (2, "CMake Error at CMakeLists.txt:7\n-- Configuring incomplete, errors occurred!", "-- Configuring incomplete"),
]


def cause(tmp_path, status, text, disk_free_kb=10**7):
    (tmp_path / "log").write_text(f"# a log\n{text}\n")
    (tmp_path / "df").write_text(f"#!/bin/sh\necho header\necho /dev/disk 1 1 {disk_free_kb} 1% /\n")
    (tmp_path / "df").chmod(0o755)
    script = 'STATE=$1 LAB_ROOT=$1; source "$2/tools/setup_run.bash"; step_log=$1/log; cause_of "$3"'
    done = subprocess.run(["bash", "-uc", script, "test", tmp_path, ROOT, str(status)], capture_output=True, text=True,
                          check=True, env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"})
    return done.stdout


@pytest.mark.parametrize(("status", "text", "expected"), SAYINGS)
def test_the_cause_in_words(tmp_path, status, text, expected):
    assert cause(tmp_path, status, text).startswith(expected)


def test_a_disk_without_room_is_the_cause_whatever_the_log_says(tmp_path):
    said = cause(tmp_path, 1, "OSError: write error", disk_free_kb=12)
    assert said.startswith("the disk is full: nothing is left for")


def test_nothing_can_be_written_at_all(workspace):
    root, _ = workspace
    (root / ".baxter").touch()  # a file in place of the folder
    status, said = finish(start(root))
    assert status == 1 and f"cannot write to {root}/.baxter: a file there is not writable" in said
