# SPDX-License-Identifier: BSD-3-Clause
"""Systems without ROS 1: the command line that baxter.sh gives to podman or docker, by fakes that write it down."""

import json
import os
import pty
import re
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from lab_testing.waiting import wait_until

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 60
# Writes its arguments down, one in a line; `run` then does what the file `then` says.
ENGINE = r"""#!/bin/bash
here=${0%/*}
printf '%s\n' "${0##*/}" "$@" >>"$here/said"
case $1 in
    --version) echo "@NAME@ version 5" ;;
    info) cat "$here/info" 2>/dev/null ;;
    image) [[ -e $here/has_image ]] ;;
    build) touch "$here/has_image" ;;
    run) . "$here/then" ;;
esac
"""
SYSTEMS = {
    # Lines of /etc/os-release, and whether the system has no ROS 1.
    "Debian 12": ("ID=debian\nVERSION_CODENAME=bookworm", False),
    "Debian sid": ("ID=debian\nVERSION_CODENAME=forky", False),
    "Ubuntu 22.04": ("ID=ubuntu\nVERSION_CODENAME=jammy\nUBUNTU_CODENAME=jammy", False),
    "Ubuntu 24.04": ("ID=ubuntu\nVERSION_CODENAME=noble\nUBUNTU_CODENAME=noble", True),
    "a derivative of it": ("ID=linuxmint\nVERSION_CODENAME=wilma\nUBUNTU_CODENAME=noble", True),
    "Ubuntu 26.04": ("ID=ubuntu\nVERSION_CODENAME=resolute\nUBUNTU_CODENAME=resolute", True),
    "Ubuntu 20.04": ("ID=ubuntu\nVERSION_CODENAME=focal\nUBUNTU_CODENAME=focal", True),
    "an unknown one with apt": ("ID=other\nVERSION_CODENAME=other", False),
}


def test_the_dev_container_is_a_stage_with_its_user_and_forwards_the_page():
    wanted = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    file = (ROOT / ".devcontainer" / wanted["build"]["dockerfile"]).resolve()
    assert (ROOT / ".devcontainer" / wanted["build"]["context"]).resolve() == ROOT
    stage = file.read_text().split(f" AS {wanted['build']['target']}\n")[1].split("\nFROM ")[0]
    assert f" {wanted['remoteUser']}\n" in stage and "COPY" not in stage
    page = (ROOT / "src/lab/lab_web/src/lab_web/node.py").read_text()
    assert f"\nFIRST_PORT = {wanted['forwardPorts'][0]}\n" in page
    for command in (wanted["postCreateCommand"], wanted["postAttachCommand"]):
        assert (ROOT / command.split()[0]).exists()


@pytest.mark.parametrize(("processor", "expected"), [
    ("amd64", ""), ("arm64", "update\ninstall -y --no-install-recommends libegl-dev libgl-dev\n")])
def test_the_stage_that_compiles_has_what_it_links_with(tmp_path, processor, expected):
    """Debian 13's ROS packages bring no libraries of OpenGL to link with."""
    stage = (ROOT / "docker/Dockerfile").read_text().split(" AS wheels\n")[1].split("\nFROM ")[0]
    command = re.search(r"^RUN (if .*?[^\\])$", stage, re.S | re.M)[1]
    for name, body in {"dpkg": f"echo {processor}", "apt-get": f'echo "$@" >>{tmp_path}/said'}.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    (tmp_path / "said").touch()
    subprocess.run(["sh", "-c", command], check=True, env={"PATH": f"{tmp_path}:/usr/bin:/bin"})
    assert (tmp_path / "said").read_text() == expected


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """A folder with the programs of this machine but its engines, of which a test has its own."""
    folder = tmp_path_factory.mktemp("programs")
    for name in {name for place in ("/bin", "/usr/bin") for name in os.listdir(place)} - {"podman", "docker"}:
        (folder / name).symlink_to(shutil.which(name, path="/usr/bin:/bin") or f"/usr/bin/{name}")
    return folder


@pytest.fixture
def machine(tmp_path, programs):
    """(workspace, folder of engines, environment): a machine whose PATH has a fake podman."""
    workspace, engines, home = tmp_path / "ws", tmp_path / "bin", tmp_path / "home"
    for folder in (engines, home, workspace / "docker"):
        folder.mkdir(parents=True)
    shutil.copy(ROOT / "baxter.sh", workspace)
    shutil.copytree(ROOT / "tools", workspace / "tools", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "docker" / "Dockerfile", workspace / "docker")
    add_engine(engines, "podman")
    (engines / "then").write_text("exit 0\n")
    return workspace, engines, {"PATH": f"{engines}:{programs}", "HOME": str(home), "BAXTER_CONTAINER": "1"}


def add_engine(folder, name):
    (folder / name).write_text(ENGINE.replace("@NAME@", name))
    (folder / name).chmod(0o755)


def baxter(machine, *words, cwd=None, **variables):
    workspace, _, environment = machine
    return subprocess.run([workspace / "baxter.sh", *words], cwd=cwd or workspace, env={**environment, **variables},
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=LIMIT_S)


def calls(machine):
    """The engine's calls, each a list of words."""
    said, found = (machine[1] / "said"), []
    for word in said.read_text().splitlines() if said.exists() else []:
        if word in ("podman", "docker"):
            found.append([])
        else:
            found[-1].append(word)
    return found


def the_run(machine):
    run, = (call for call in calls(machine) if call[0] == "run")
    return run


def values(call, option):
    return [value for name, value in zip(call, call[1:], strict=False) if name == option]


@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_without_ros_1_are_known(tmp_path, name):
    lines, lacks = SYSTEMS[name]
    (tmp_path / "os-release").write_text(f'PRETTY_NAME="{name}"\n{lines}\n')
    script = 'source "$1/tools/platform.bash"; apt-get() { :; }; lacks_ros1 "$2" /nowhere'
    done = subprocess.run(["bash", "-c", script, "test", ROOT, tmp_path / "os-release"], capture_output=True, text=True)
    assert (done.returncode == 0) == lacks
    assert (name in done.stdout) == lacks


@pytest.mark.parametrize("words", [
    ("sim", "rosrun", "rf_lab2", "two words"), ("notebook", "7"), ("web",), ("test", "-k", "a or b"),
    ("check", "wave", "x.py"), ("setup", "apt"), ("sim", "--public", "true"), ("127.1.1.1",)],
    ids=lambda words: words[0])
def test_each_mode_runs_inside_on_the_workspace_as_the_user(machine, words):
    workspace, engines, environment = machine
    (engines / "has_image").touch()
    done = baxter(machine, *words, ROS_MASTER_URI="http://localhost:11999", FOREIGN="x")
    assert done.returncode == 0, done.stderr
    run = the_run(machine)
    image = next(index for index, word in enumerate(run) if "baxter-lab-system:" in word)
    inside = ("sim",) if words == ("127.1.1.1",) else words
    assert tuple(run[image + 1:]) == inside
    assert values(run, "--entrypoint") == [f"{workspace}/baxter.sh"] and values(run, "--workdir") == [str(workspace)]
    mounted = [volume.split(":")[0] for volume in values(run, "--volume")]
    assert any(f"{workspace}/".startswith(f"{folder}/") for folder in mounted)
    assert any(f"{environment['HOME']}/".startswith(f"{folder}/") for folder in mounted)
    passed = values(run, "--env")
    assert {"ROS_MASTER_URI", "BAXTER_CONTAINER=0", f"HOME={environment['HOME']}"} < set(passed)
    assert "FOREIGN" not in passed
    assert values(run, "--network") == values(run, "--pid") == ["host"]
    assert ("--userns" in run) == (os.getuid() != 0) and "--tty" not in run


def test_docker_gets_the_users_numbers_and_podman_is_preferred(machine):
    workspace, engines, _ = machine
    (engines / "has_image").touch()
    (engines / "podman").unlink()
    add_engine(engines, "docker")
    assert baxter(machine, "sim", "true").returncode == 0
    run = the_run(machine)
    assert values(run, "--user") == [f"{os.getuid()}:{os.getgid()}"] and "--privileged" not in run
    assert f":{os.getuid()}:{os.getgid()}:" in (workspace / ".baxter" / "accounts").read_text()
    (engines / "info").write_text("[name=seccomp name=rootless]\n")
    (engines / "said").unlink()
    assert baxter(machine, "sim", "true").returncode == 0
    assert values(the_run(machine), "--user") == ["0:0"]


def test_the_image_is_made_once_and_again_when_its_packages_change(machine):
    workspace, engines, _ = machine
    done = baxter(machine, "sim", "true", DEBIAN_MIRROR="http://mirror.example/debian")
    assert done.returncode == 0 and "BAXTER_CONTAINER is 1" in done.stderr and "podman" in done.stderr
    build, = (call for call in calls(machine) if call[0] == "build")
    assert values(build, "--target") == ["system"] and build[-1] == str(workspace)
    assert values(build, "--build-arg") == ["DEBIAN_MIRROR=http://mirror.example/debian"]
    first, = values(build, "-t")
    assert first in the_run(machine)
    (workspace / "tools" / "apt_packages.txt").write_text("another\n")
    (engines / "has_image").unlink()
    (engines / "said").unlink()
    baxter(machine, "sim", "true")
    assert first not in the_run(machine)


def test_the_exit_code_and_signals_pass(machine):
    workspace, engines, environment = machine
    (engines / "has_image").touch()
    (engines / "then").write_text("exit 42\n")
    assert baxter(machine, "sim", "false").returncode == 42
    (engines / "then").write_text('trap "exit 7" INT; touch "$here/runs"; while :; do read -rt 0.1 <> <(:); done\n')
    process = subprocess.Popen([workspace / "baxter.sh", "sim", "true"], env=environment, stdin=subprocess.DEVNULL)
    wait_until(lambda: (engines / "runs").exists(), "the command inside", LIMIT_S)
    process.send_signal(signal.SIGINT)
    assert process.wait(LIMIT_S) == 7


def test_a_terminal_is_passed_on(machine):
    workspace, engines, environment = machine
    (engines / "has_image").touch()
    leader, terminal = pty.openpty()
    try:
        done = subprocess.run([workspace / "baxter.sh", "sim", "true"], env=environment, stdin=terminal,
                              stdout=terminal, stderr=subprocess.PIPE, timeout=LIMIT_S)
    finally:
        os.close(leader)
        os.close(terminal)
    assert done.returncode == 0 and "--tty" in the_run(machine)


def test_without_an_engine_the_command_that_installs_one_is_printed(machine):
    _, engines, _ = machine
    (engines / "podman").unlink()
    (engines / "dnf").symlink_to("/bin/true")
    tools = ("bash", "readlink", "dirname", "sed", "tr", "awk", "id", "stat", "cat", "uname", "env")
    for name in tools:
        (engines / name).symlink_to(shutil.which(name))
    done = baxter(machine, "sim", "true", PATH=str(engines))
    assert done.returncode == 1 and "BAXTER_CONTAINER is 1" in done.stderr
    assert done.stderr.splitlines()[-1].endswith("dnf install podman")


def test_a_wrong_choice_is_told_and_none_leaves_the_machine_alone(machine):
    done = baxter(machine, "sim", "true", BAXTER_CONTAINER="yes")
    assert done.returncode == 2 and "'yes'" in done.stderr
    script = 'for name in platform container; do source "$1/tools/$name.bash"; done; use_container sim && echo here'
    done = subprocess.run(["bash", "-c", script, "test", ROOT], env={**machine[2], "BAXTER_CONTAINER": "0"},
                          capture_output=True, text=True)
    assert done.stdout == "here\n" and calls(machine) == []


def test_questions_and_the_doctor_make_no_image(machine):
    for words in (("help",), ("sim", "--help"), ("check", "--help")):
        assert baxter(machine, *words).returncode == 0
    assert calls(machine) == []
    done = baxter(machine, "doctor")
    assert done.returncode == 1 and "setup" in done.stdout
    assert [call[0] for call in calls(machine)] == ["image"]


def test_a_folder_elsewhere_is_mounted_and_a_folder_of_the_system_is_not(machine):
    workspace, engines, _ = machine
    (engines / "has_image").touch()
    baxter(machine, "check", "wave", "x.py", cwd="/usr")
    assert values(the_run(machine), "--workdir") == [str(workspace)]
    assert not any(volume.startswith("/usr") for volume in values(the_run(machine), "--volume"))
    (engines / "said").unlink()
    baxter(machine, "check", "wave", "x.py", cwd="/var/tmp")
    assert values(the_run(machine), "--workdir") == ["/var/tmp"]
    assert "/var/tmp:/var/tmp" in values(the_run(machine), "--volume")
