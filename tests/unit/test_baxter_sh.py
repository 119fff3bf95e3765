# SPDX-License-Identifier: BSD-3-Clause
"""baxter.sh: its arguments, and the ROS variables of its commands. No test sets up or builds."""

import fcntl
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from lab_tests import comma_locale

ROOT = Path(__file__).resolve().parents[2]
ROS_VARIABLES = ("ROS_MASTER_URI", "ROS_HOSTNAME", "ROS_IP")
# Stand-ins for the resolver and the routing table, so that the tests need no network.
FAKE_TOOLS = {
    "getent": 'case $2 in baxter.local | 10.42.0.2) echo "10.42.0.2 STREAM" ;; *) exit 2 ;; esac',
    "ip": 'echo "10.42.0.2 dev eth1 src 10.42.0.1 uid 0"',
}


@pytest.fixture
def variables_after(tmp_path):
    """Call a function of environment.bash with some variables set; the ROS variables that a child then sees."""
    for name, body in FAKE_TOOLS.items():
        (tmp_path / name).write_text(f"#!/bin/bash\n{body}\n")
        (tmp_path / name).chmod(0o755)

    def call(function, **variables):
        script = f'LAB_ROOT="{ROOT}"; source "{ROOT}/tools/environment.bash"; {function} && env'
        environment = {"PATH": f"{tmp_path}:/usr/bin:/bin", **variables}
        done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        pairs = (line.split("=", 1) for line in done.stdout.splitlines() if "=" in line)
        return {name: value for name, value in pairs if name in ROS_VARIABLES}

    return call


def test_whether_set_up_is_due_does_not_depend_on_the_language(tmp_path):
    script = f'LAB_ROOT="{ROOT}"; source "{ROOT}/tools/environment.bash"; fingerprint'
    german = {**comma_locale.variables(tmp_path), "PATH": "/usr/bin:/bin"}
    seen = {
        subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, check=True).stdout
        for environment in ({"PATH": "/usr/bin:/bin", "LC_ALL": "C"}, german)
    }
    assert len(seen) == 1 and len(seen.pop()) > 64


LOCAL = {"ROS_MASTER_URI": "http://localhost:11311", "ROS_HOSTNAME": "localhost"}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, LOCAL),
        ({"ROS_IP": "192.168.0.4", "ROS_HOSTNAME": "desk.local"}, LOCAL),
        ({"ROS_MASTER_URI": "http://baxter.local:11311"}, LOCAL),
        ({"ROS_MASTER_URI": "http://localhost:11411"}, {**LOCAL, "ROS_MASTER_URI": "http://localhost:11411"}),
        ({"ROS_MASTER_URI": "http://127.0.0.1:11411/"}, {**LOCAL, "ROS_MASTER_URI": "http://127.0.0.1:11411/"}),
        ({"ROS_MASTER_URI": "http://localhost.example.org:11411"}, LOCAL),
    ],
    ids=["nothing set", "an address set", "a robot's master", "another port", "by address", "a name that looks local"],
)
def test_sim_stays_on_this_machine(variables_after, given, expected):
    assert variables_after("use_loopback", **given) == expected


ROBOT = {"ROS_MASTER_URI": "http://baxter.local:11311"}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, {**ROBOT, "ROS_IP": "10.42.0.1"}),
        ({"ROS_IP": "10.9.9.9"}, {**ROBOT, "ROS_IP": "10.9.9.9"}),
        ({"ROS_HOSTNAME": "desk.local"}, {**ROBOT, "ROS_HOSTNAME": "desk.local"}),
        ({"ROS_HOSTNAME": "localhost"}, {**ROBOT, "ROS_IP": "10.42.0.1"}),
        ({"ROS_IP": "127.0.0.1"}, {**ROBOT, "ROS_IP": "10.42.0.1"}),
        ({"ROS_MASTER_URI": "http://baxter.local:11411"},
         {"ROS_MASTER_URI": "http://baxter.local:11411", "ROS_IP": "10.42.0.1"}),
    ],
    ids=["found from the route", "own address wins", "own name wins", "left over from sim", "loopback address",
         "another port there"],
)
def test_robot_is_told_an_address_that_it_can_reach(variables_after, given, expected):
    assert variables_after("use_robot baxter.local", **given) == expected


def test_robot_by_address(variables_after):
    assert variables_after("use_robot 10.42.0.2") == {"ROS_MASTER_URI": "http://10.42.0.2:11311", "ROS_IP": "10.42.0.1"}


OPEN = {"ROS_MASTER_URI": "http://10.42.0.1:11311", "ROS_IP": "10.42.0.1"}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, OPEN),
        ({"ROS_MASTER_URI": "http://localhost:11411", "ROS_HOSTNAME": "localhost"},
         {"ROS_MASTER_URI": "http://10.42.0.1:11411", "ROS_IP": "10.42.0.1"}),
        ({"ROS_IP": "10.9.9.9"}, {"ROS_MASTER_URI": "http://10.9.9.9:11311", "ROS_IP": "10.9.9.9"}),
        ({"ROS_HOSTNAME": "desk.local"}, {"ROS_MASTER_URI": "http://desk.local:11311", "ROS_HOSTNAME": "desk.local"}),
        ({"ROS_MASTER_URI": "http://baxter.local:11911"}, OPEN),
    ],
    ids=["found from the route", "left over from sim", "own address wins", "own name wins", "a robot's master"],
)
def test_public_announces_an_address_that_others_reach(variables_after, given, expected):
    assert variables_after("use_public", **given) == expected


def test_public_by_address(variables_after):
    expected = {"ROS_MASTER_URI": "http://10.1.2.3:11311", "ROS_IP": "10.1.2.3"}
    assert variables_after("use_public 10.1.2.3", ROS_IP="10.9.9.9") == expected


@pytest.mark.parametrize(("port", "line"), [
    ("11311", "There: ./baxter.sh 10.1.2.3"),
    ("11411", "There: ROS_MASTER_URI=http://10.1.2.3:11411 ./baxter.sh 10.1.2.3")])
def test_public_prints_the_line_for_other_machines(port, line):
    script = f'LAB_ROOT="{ROOT}"; source "{ROOT}/tools/environment.bash"; use_public 10.1.2.3'
    environment = {"PATH": "/usr/bin:/bin", "ROS_MASTER_URI": f"http://localhost:{port}"}
    assert line in subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True).stderr


def baxter(*arguments, script=ROOT / "baxter.sh", **options):
    options.update(capture_output=True, text=True, stdin=subprocess.DEVNULL)
    return subprocess.run([str(script), *arguments], **options)


def test_help_needs_no_set_up_and_works_through_a_link(tmp_path):
    (tmp_path / "lab").symlink_to(ROOT / "baxter.sh")
    done = baxter("help", script=tmp_path / "lab", cwd="/", env={"PATH": "/usr/bin:/bin"})
    assert done.returncode == 0
    for mode in ("sim", "HOST", "setup", "test", "doctor"):
        assert f"\n  {mode}" in done.stdout


def modes():
    """The modes of the table, without HOST."""
    return sorted({line.split()[0] for line in baxter("help").stdout.splitlines() if re.match("  [a-z]", line)})


def test_each_mode_has_help_without_a_build(tmp_path):
    copy, known = copy_of_tools(tmp_path / "ws"), modes()
    assert {"sim", "setup", "test", "labs", "doctor"} < set(known)
    for mode in [*known, "localhost", "some-robot"]:
        if mode == "handout":  # its own help needs its package
            continue
        done = baxter(mode, "--help", script=copy / "baxter.sh")
        assert (done.returncode, done.stderr) == (0, ""), mode
        shown = "sim" if mode == "localhost" else mode if mode in known else "HOST"
        assert f"\n  {shown}" in done.stdout
    assert "meshes" in baxter("setup", "-h", script=copy / "baxter.sh").stdout  # one of its steps


@pytest.mark.parametrize(("words", "meant"), [
    ("notebok 7_waving", "notebook 7_waving"), ("tset", "test"), ("chek --list", "check --list"),
    ("lab up 3", "labs up 3"), ("notebok --help", "notebook --help"), ("no-such-host.invalid true", None),
    ("x", None), ("SIM true", "sim true"), ("Helpp", "help"),
])
def test_a_slip_in_a_mode_is_told_with_the_line_that_was_meant(words, meant):
    done = baxter(*words.split())
    assert done.returncode == 2 and words.split()[0] in done.stderr
    assert ("did you mean" in done.stderr) == bool(meant)
    assert not meant or f"./baxter.sh {meant}?" in done.stderr


def test_version_is_that_of_all_packages():
    version = baxter("--version").stdout.split()[-1]
    manifests = subprocess.run(["grep", "-rhoP", "--include=package.xml", "(?<=<version>).*(?=</version>)",
                                *sorted(map(str, (ROOT / "src").glob("*/")))], capture_output=True, text=True).stdout
    of_pip = re.search(r'^version = "(.*)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE)[1]
    assert {*manifests.split(), of_pip} == {version}
    assert [baxter(mode, "--version").stdout.split()[-1:] for mode in modes() if mode not in ("grade", "help")] == [
        [version]] * (len(modes()) - 2)


def test_help_while_set_up_is_at_work_needs_no_build(tmp_path):
    copy = copy_of_tools(tmp_path / "ws")
    for name in ("devel/setup.bash", ".baxter/build.stamp", ".venv/bin/python3"):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text("")
        (copy / name).chmod(0o755)
    with open(copy / ".baxter/lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = baxter("batch-node", "--help", script=copy / "baxter.sh")
    assert (done.returncode, done.stderr) == (0, "") and "batch-node" in done.stdout


def test_unknown_option_and_unknown_host_are_refused():
    for words in (["--simulate"], ["sim", "--pubic"], ["localhost", "-x"], ["doctor", "--hosts"]):
        assert baxter(*words).returncode == 2
    done = baxter("no-such-host.invalid", "true")
    assert done.returncode == 2
    assert "no-such-host.invalid" in done.stderr and "help" in done.stderr


def copy_of_tools(folder):
    """The parts of the workspace that the scripts need, without a build."""
    folder.mkdir(parents=True)
    subprocess.run(["cp", "-r", str(ROOT / "baxter.sh"), str(ROOT / "tools"), str(folder)], check=True)
    for name in ("requirements.txt", "requirements-nodeps.txt"):
        subprocess.run(["cp", str(ROOT / name), str(folder)], check=True)
    (folder / "src/base").mkdir(parents=True)
    subprocess.run(["cp", "-r", str(ROOT / "src/base/master_calls"), str(folder / "src/base")], check=True)
    return folder


def test_path_with_spaces_is_refused_in_words(tmp_path):
    copy = copy_of_tools(tmp_path / "my workspace")
    done = baxter("sim", "true", script=copy / "baxter.sh")
    assert done.returncode == 1
    assert "spaces" in done.stderr and str(copy) in done.stderr


def test_failing_step_is_named_with_command_and_log(tmp_path):
    """An apt that fails: the first step ends with what was run, where its log is, and how the log ends."""
    copy = copy_of_tools(tmp_path / "ws")
    (copy / "tools" / "apt_packages.txt").write_text("no-such-package-anywhere\n")
    fake = tmp_path / "bin"
    fake.mkdir()
    bodies = {"apt-get": "echo 'E: the archive is on fire'; exit 100", "sudo": '[[ $1 == -v ]] || exec "$@"'}
    for name, body in bodies.items():
        (fake / name).write_text(f"#!/bin/bash\n{body}\n")
        (fake / name).chmod(0o755)
    setup = (copy / "tools" / "setup.bash").read_text()
    (copy / "tools" / "setup.bash").write_text(setup.replace("export PATH=", f"export PATH={fake}:"))
    done = baxter("setup", script=copy / "baxter.sh", env={**os.environ})
    assert done.returncode == 100
    for text in ("step 'Debian packages'", "apt-get update", ".baxter/logs/apt.log", "the archive is on fire"):
        assert text in done.stderr


def fingerprint(folder):
    script = 'LAB_ROOT=$1; source "$1/tools/environment.bash"; fingerprint'
    return subprocess.run(["bash", "-c", script, "x", str(folder)], capture_output=True, text=True, check=True).stdout


def test_set_up_is_stale_when_what_it_reads_has_changed(tmp_path):
    copy = copy_of_tools(tmp_path / "ws")
    seen = [fingerprint(copy)]
    for change in ("src/compat/foo/package.xml", "src/compat/foo/msg/Bar.msg", "src/probot/foo/urdf/foo.xacro",
                   "requirements.txt"):
        (copy / change).parent.mkdir(parents=True, exist_ok=True)
        (copy / change).write_text("changed")
        seen.append(fingerprint(copy))
    (copy / "src/compat/foo/node.py").write_text("print()")
    assert fingerprint(copy) == seen[-1]  # Python needs no build
    assert len(set(seen)) == len(seen)


def test_the_lab_is_all_that_is_in_src():
    """Packages outside of LAB_FOLDERS count as the user's own."""
    script = 'LAB_ROOT=$1; source "$1/tools/environment.bash"; printf "%s\\n" "${LAB_FOLDERS[@]}"'
    listed = subprocess.run(["bash", "-c", script, "x", str(ROOT)], capture_output=True, text=True, check=True).stdout
    tracked = subprocess.run(["git", "ls-files", "src"], cwd=ROOT, capture_output=True, text=True)
    if tracked.returncode:
        pytest.skip("no git checkout")
    assert {path.split("/")[1] for path in tracked.stdout.splitlines()} | {"overlay"} == set(listed.split())


@pytest.fixture
def set_up_copy(tmp_path):
    """A workspace that looks set up to baxter.sh; builds of the user's own packages are recorded in `builds`."""
    copy = copy_of_tools(tmp_path / "ws")
    for name in ("devel/setup.bash", ".baxter/build.stamp", ".venv/bin/python3"):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).touch(mode=0o755)
    (copy / "tools/setup.bash").write_text("echo set-up was started; exit 7\n")
    (copy / "tools/own_packages.py").write_text(
        "import pathlib, sys\nroot = pathlib.Path(sys.argv[1])\n"
        "open(root / 'builds', 'a').write(' '.join(sys.argv[2:]) + '\\n')\n"
        "sys.exit('does not build' if (root / 'broken').exists() else 0)\n")
    (copy / ".baxter/done").write_text(fingerprint(copy))
    return copy


def test_set_up_is_stale_when_an_inner_loop_has_changed(set_up_copy):
    script = 'LAB_ROOT=$1; source "$1/tools/environment.bash"; is_set_up "$(fingerprint)"'
    loop = set_up_copy / "loop.py"
    for text, is_set_up in (("one", True), ("two", False), (None, False)):
        if text is None:
            loop.unlink()
        else:
            loop.write_text(text)
        if is_set_up:
            sums = subprocess.run(["sha256sum", str(loop)], capture_output=True, text=True, check=True).stdout
            (set_up_copy / ".baxter/kernels.sums").write_text(sums)
        done = subprocess.run(["bash", "-c", script, "x", str(set_up_copy)], capture_output=True, text=True)
        assert (done.returncode == 0, done.stdout, done.stderr) == (is_set_up, "", "")


def new_package(copy, name):
    (copy / "src" / name).mkdir()
    (copy / "src" / name / "package.xml").write_text(
        f"<package><name>{name}</name><version>1.0.0</version><description>mine</description><maintainer "
        'email="a@b.example">a</maintainer><license>BSD-3-Clause</license></package>')


def builds(copy):
    return (copy / "builds").read_text().splitlines() if (copy / "builds").exists() else []


def test_ones_own_package_starts_no_set_up_and_holds_up_no_command_of_the_lab(set_up_copy):
    new_package(set_up_copy, "foo")
    for command in (["rosrun", "baxter_tools", "enable_robot.py"],
                    ["roslaunch", "baxter_gazebo", "baxter_world.launch"]):
        done = baxter("sim", *command, script=set_up_copy / "baxter.sh", env={"PATH": "/usr/bin:/bin"})
        assert "set-up" not in done.stdout + done.stderr
        assert builds(set_up_copy) == []
    for _ in range(2):
        done = baxter("sim", "true", script=set_up_copy / "baxter.sh")
        assert (done.returncode, done.stderr) == (0, "")
    assert builds(set_up_copy) == ["foo"]
    (set_up_copy / "src/foo/msg").mkdir()
    (set_up_copy / "src/foo/msg/Bar.msg").write_text("float64 x")
    baxter("sim", "rosrun", "foo", "node.py", script=set_up_copy / "baxter.sh")
    assert builds(set_up_copy) == ["foo"] * 2


def test_another_shell_that_builds_is_waited_for_only_by_who_needs_it(set_up_copy):
    new_package(set_up_copy, "foo")
    with open(set_up_copy / ".baxter/own_lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = baxter("sim", "echo", "works", script=set_up_copy / "baxter.sh", timeout=60)
        assert done.stdout == "works\n" and "another shell is building" in done.stderr
        waiting = subprocess.Popen([set_up_copy / "baxter.sh", "sim", "echo", "foo"], stderr=subprocess.PIPE, text=True,
                                   stdout=subprocess.DEVNULL)
        assert "waiting for it to finish" in waiting.stderr.readline()
        assert builds(set_up_copy) == []
    waiting.communicate(timeout=60)
    assert builds(set_up_copy) == ["foo"]


def test_a_set_up_in_another_shell_holds_up_nobody_while_nothing_has_changed(set_up_copy):
    (set_up_copy / ".baxter/at_work").write_text("build\n")
    with open(set_up_copy / ".baxter/lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert baxter("sim", "echo", "works", script=set_up_copy / "baxter.sh", timeout=60).stdout == "works\n"
    # Nobody holds the lock: that set-up was interrupted.
    assert "set-up was started" in baxter("sim", "true", script=set_up_copy / "baxter.sh").stderr


def test_ones_own_package_that_does_not_build_locks_nobody_out_and_is_tried_once(set_up_copy):
    new_package(set_up_copy, "foo")
    (set_up_copy / "broken").touch()
    for text in ("does not build", "continuing without it"):
        done = baxter("sim", "echo", "works", script=set_up_copy / "baxter.sh")
        assert done.stdout == "works\n" and text in done.stderr
    assert builds(set_up_copy) == ["foo"]


def test_failing_set_up_leaves_the_earlier_build_usable_and_is_tried_once(tmp_path):
    """A student's package that does not configure must not block its author, nor slow down every command."""
    copy = copy_of_tools(tmp_path / "ws")
    (copy / "tools" / "setup.bash").write_text('echo tried >>"$LAB_ROOT/tries"; exit 7\n')
    assert baxter("sim", "true", script=copy / "baxter.sh").returncode == 7  # no earlier build
    for name in ("devel/setup.bash", ".baxter/build.stamp", ".venv/bin/python3"):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).touch(mode=0o755)
    for _ in range(2):
        done = baxter("sim", "bash", "-c", "echo works; exit 3", script=copy / "baxter.sh")
        assert (done.returncode, done.stdout) == (3, "works\n")
        assert "set-up has failed" in done.stderr
    assert (copy / "tries").read_text() == "tried\n" * 2
    assert baxter("test", script=copy / "baxter.sh").returncode == 7  # tests of a stale build would be meaningless


@pytest.fixture
def workspace(tmp_path):
    """A workspace with a build that is older than its sources; a set-up there only leaves a mark."""
    shutil.copy(ROOT / "baxter.sh", tmp_path)
    files = {
        "tools/setup.bash": 'touch "$LAB_ROOT/was_set_up"',
        "devel/setup.bash": "",
        ".venv/bin/python3": "#!/bin/bash",
        ".baxter/build.stamp": "",
        "src/courses/rf_checks/scripts/check": "import sys; print(*sys.argv[1:])",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / ".venv/bin/python3").chmod(0o755)
    for name in ("environment.bash", "platform.bash", "container.bash", "arguments.py"):
        shutil.copy(ROOT / "tools" / name, tmp_path / "tools")
    return tmp_path


@pytest.mark.parametrize(("words", "is_set_up"), [
    (["--start", "wave"], False), (["--start=wave"], False), (["--list"], False), (["--help"], False),
    (["lab2", "wave.py"], True),
])
def test_a_skeleton_does_not_wait_for_a_set_up(workspace, words, is_set_up):
    command = ["bash", workspace / "baxter.sh", "check", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == words
    assert (workspace / "was_set_up").exists() == is_set_up


@pytest.fixture(scope="module")
def fresh_clone(tmp_path_factory):
    """A workspace with all sources and without a build; its set-up leaves a mark and fails."""
    root = tmp_path_factory.mktemp("clone") / "ws"
    copy_of_tools(root)
    shutil.rmtree(root / "src")
    (root / "src").symlink_to(ROOT / "src")
    (root / "tests").symlink_to(ROOT / "tests")
    (root / "tools/setup.bash").write_text('touch "$LAB_ROOT/was_set_up"; exit 7\n')
    (root / "wave.py").write_text("")
    return root


REFUSED = {
    "check": "which program", "check lab2": "LAB [EXERCISE] PROGRAM",
    "check lab2 nowhere.py": "nowhere.py is not there", "check lab2 .": "is a folder",
    "check wave.py": "did you mean ./baxter.sh check lab2 wave.py?", "check lab3 wave.py": "did you mean lab2?",
    "check wave wave.py": "an exercise of lab2", "check lab2 wav wave.py": "did you mean wave?",
    "check lab2 wave.py --sed 3": "did you mean --seed?", "check lab2 wave.py --seed x": "a whole number from 0",
    "check --start wav": "did you mean wave?", "check --start": "--start",
    "check lab2 wave.py --profile real": "robot", "check cwru wave wave.py": "not of cwru",
    "grade": "which folder", "grade nowhere": "neither a folder nor", "grade . lab4": "did you mean lab2?",
    "grade . lab2 wav": "did you mean wave?", "grade . --workers 0": "from 1",
    "labs": "up|list", "labs downn": "did you mean down?", "labs up nowhere.csv": "nowhere.csv",
    "learn": "Reach", "learn Lift": "TwoArmLift", "learn --judge nowhere.npz": "no nowhere.npz",
    "batch": "--list", "batch ik": "--seeds", "batch ikk --seeds 0:3": "did you mean ik?",
    "batch ik --seeds": "--seeds", "batch-node": "--listen", "batch-node --listen 10.0.0.1": "--head",
    "batch-node --head --address a:1 --listen b": "--head",
    "bench plannig": "did you mean planning?", "bench fidelity --recording nowhere.csv": "nowhere.csv",
    "sysid": "--arm left", "sysid nowhere.csv": "nowhere.csv", "sysid --arm both": "one arm at a time",
    "notebook wavng": "did you mean 7_waving?", "notebook --port x": "--port", "web --prt 80": "did you mean --port?",
    "conformance --tmeout 3": "did you mean --timeout?", "conformance --timeout 0": "above 0",
    "test nowhere": "'nowhere' is not a package", "test --repeat x": "--repeat",
    "sim ./nowhere.py": "no program ./nowhere.py", "10.0.0.1 ./nowhere.py": "no program ./nowhere.py",
}
ACCEPTED = (
    "check lab2 wave.py", "check lab2 wave wave.py --seed 3", "check --seed=3 lab2 wave.py", "check cwru wave.py --tru",
    "grade .", "grade . lab2 wave --out x", "grade --version", "labs up 3 --port 8000", "labs up --public", "labs down",
    "labs --folder x list", "labs renew all", "learn Reach --steps 3", "learn --judge wave.py", "batch ik --seeds 0:3",
    "batch a.b:C --seeds 1", "batch ik --seeds 0:3 --set a=1 --set b=2", "batch-node --head --listen 10.0.0.1", "bench",
    "bench ik --quick", "bench --list", "sysid wave.py --arm both", "sysid --arm left --out a.yaml", "notebook",
    "notebook 7_waving", "notebook --list", "web", "web --port 80 __name:=page", "web --no-notebook", "conformance",
    "conformance localhost --json x", "test", "test bullet_sim -k foo --lf", "test --busy",
    "test --busy=30 test_words.py", "test --busy bullet_sim", "test --changed", "test torture", "test -x --repeat 3",
    "check --list", "check --start wave", "sim python3 nowhere.py", "sim", "sim devel/lib/x", "sim bash -c ./nowhere",
)


@pytest.mark.parametrize("words", REFUSED)
def test_what_can_be_judged_without_a_set_up_is_refused_before_it(fresh_clone, words):
    done = baxter(*words.split(), script=fresh_clone / "baxter.sh", cwd=fresh_clone)
    assert REFUSED[words] in done.stderr and done.returncode == (127 if "./nowhere.py" in words else 2), done
    assert not (fresh_clone / "was_set_up").exists()
    assert done.stdout == "" and len(done.stderr.splitlines()) == 1


def test_a_path_of_a_test_counts_from_the_workspace_as_its_program_reads_it(fresh_clone, tmp_path):
    done = baxter("test", "tests/unit/test_words.py", script=fresh_clone / "baxter.sh", cwd=tmp_path)
    assert (fresh_clone / "was_set_up").exists() and done.returncode == 7, done
    (fresh_clone / "was_set_up").unlink()


@pytest.mark.parametrize("words", ACCEPTED)
def test_what_may_be_right_is_not_refused_before_a_set_up(fresh_clone, words):
    done = baxter(*words.split(), script=fresh_clone / "baxter.sh", cwd=fresh_clone)
    assert (fresh_clone / "was_set_up").exists() and done.returncode == 7, done
    (fresh_clone / "was_set_up").unlink()


def test_the_words_of_every_mode_with_a_program_are_judged():
    """A mode or a source that has moved would otherwise be judged by its program alone, without a word."""
    script = f"""import pathlib, sys; sys.path.insert(0, {str(ROOT / "tools")!r})
import arguments
print(*(mode for mode in arguments.PROGRAMS if arguments.program(pathlib.Path({str(ROOT)!r}), mode).parse))"""
    done = subprocess.run(["/usr/bin/python3", "-I", "-S", "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    text = re.search(r"^declare -A PROGRAMS=\($(.*?)^\)$", (ROOT / "baxter.sh").read_text(), re.M | re.S)[1]
    assert set(done.stdout.split()) == set(re.findall(r"^ +\[([a-z-]+)\]=", text, re.M))


def test_a_robot_is_looked_for_before_a_set_up_also_where_nothing_finds_routes_yet(variables_after, tmp_path):
    """A minimal Debian has no ip; the first set-up installs it."""
    (tmp_path / "ip").unlink()
    (tmp_path / "awk").symlink_to("/usr/bin/awk")
    (tmp_path / "env").symlink_to("/usr/bin/env")
    script = f'source "{ROOT}/tools/environment.bash"; use_robot baxter.local && echo "$ROS_MASTER_URI"'
    done = subprocess.run(["/bin/bash", "-c", script], env={"PATH": str(tmp_path)}, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, ROBOT["ROS_MASTER_URI"] + "\n", "")


def test_the_doctor_of_a_fresh_clone_names_the_missing_set_up_and_no_variables(tmp_path):
    copy = copy_of_tools(tmp_path / "ws")
    done = subprocess.run(["bash", str(copy / "baxter.sh"), "doctor"], env={"PATH": "/usr/bin:/bin"},
                          capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert "./baxter.sh setup" in done.stdout and "ROS_MASTER_URI is" not in done.stdout


@pytest.mark.parametrize(("words", "uri"), [
    ([], "http://localhost:9"), ([], "http://127.0.0.1:9"), (["localhost"], "http://localhost:9"),
])
def test_the_doctor_looks_at_the_master_that_the_user_has_named(tmp_path, words, uri):
    copy = copy_of_tools(tmp_path / "ws")
    done = baxter("doctor", *words, script=copy / "baxter.sh", env={"PATH": "/usr/bin:/bin", "ROS_MASTER_URI": uri})
    assert f"{uri} does not answer" in done.stdout and "11311" not in done.stdout


def test_a_forgotten_sim_is_put_in_front_of_the_command():
    done = subprocess.run(["bash", str(ROOT / "baxter.sh"), "roslaunch", "baxter_gazebo", "baxter_world.launch"],
                          capture_output=True, text=True)
    assert done.returncode == 2
    assert "./baxter.sh sim roslaunch baxter_gazebo baxter_world.launch?" in done.stderr


def test_sh_instead_of_bash_works():
    done = subprocess.run(["sh", str(ROOT / "baxter.sh"), "help"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith("Usage:") and not done.stderr


def as_root_by_sudo(folder, owner):
    """The environment of a root shell that user 1234 has by sudo; the workspace belongs to ``owner``."""
    for name, answer in (("id", 0), ("stat", owner)):
        (folder / name).write_text(f"#!/bin/sh\necho {answer}\n")
        (folder / name).chmod(0o755)
    return {"PATH": f"{folder}:/usr/bin:/bin", "SUDO_UID": "1234", "SUDO_USER": "ann"}


def test_sudo_in_ones_own_workspace_is_refused_with_what_mends_it(tmp_path):
    done = baxter("sim", "true", env=as_root_by_sudo(tmp_path, owner=1234))
    assert done.returncode == 2
    assert "without sudo" in done.stderr and f"sudo chown -R ann '{ROOT}'" in done.stderr


def test_sudo_in_a_workspace_of_root_is_not_refused(tmp_path):
    done = baxter("--simulate", env=as_root_by_sudo(tmp_path, owner=0))
    assert done.returncode == 2 and "unknown option" in done.stderr and "sudo chown" not in done.stderr


def test_students_copy_does_not_run_on_the_first_python_in_path(tmp_path):
    (tmp_path / "python3").write_text("#!/bin/sh\necho a stranger >&2; exit 3\n")
    (tmp_path / "python3").chmod(0o755)
    done = baxter("handout", env={"PATH": f"{tmp_path}:/usr/bin:/bin"})
    assert done.returncode == 2 and "FOLDER" in done.stderr and "stranger" not in done.stderr


def writable_folders(tmp_path, **environment):
    """(stderr, {variable: value} of ROS and caches) after use_writable_folders."""
    script = f'LAB_ROOT="{ROOT}"; source "{ROOT}/tools/environment.bash"; use_writable_folders; env'
    (tmp_path / "temporary").mkdir()
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True, env={
        "PATH": "/usr/bin:/bin", "HOME": str(tmp_path / "home"), "TMPDIR": str(tmp_path / "temporary"), **environment})
    return done.stderr, {name: value for name, _, value in (line.partition("=") for line in done.stdout.splitlines())
                         if name in ("ROS_HOME", "ROS_LOG_DIR", "XDG_CACHE_HOME")}


@pytest.mark.parametrize(("make", "warns"), [("mkdir", False), ("touch", True), ("true", False)])
def test_logs_that_cannot_be_written_go_elsewhere_with_a_line_that_says_what_mends_it(tmp_path, make, warns):
    logs = tmp_path / "log"
    subprocess.run([make, str(logs)], check=True)
    said, found = writable_folders(tmp_path, ROS_LOG_DIR=str(logs))
    assert (f"cannot write to {logs}" in said and "sudo chown -R" in said) == warns
    assert warns or not said
    assert found == {"ROS_LOG_DIR": f"{tmp_path}/temporary/baxter_home_{os.getuid()}/log" if warns else str(logs)}


def test_a_lab_starts_with_a_home_that_cannot_be_written(tmp_path):
    """As a read-only one; a device stands for it, since root may write anywhere."""
    said, found = writable_folders(tmp_path, HOME="/dev/null")
    spare = Path(f"{tmp_path}/temporary/baxter_home_{os.getuid()}")
    assert "cannot write to /dev/null/.ros" in said and said.count("\n") == 1
    assert found == {"ROS_HOME": str(spare), "ROS_LOG_DIR": f"{spare}/log", "XDG_CACHE_HOME": f"{spare}/cache"}
    assert spare.stat().st_mode & 0o777 == 0o700
