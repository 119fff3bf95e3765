# SPDX-License-Identifier: BSD-3-Clause
"""`--help` of every installed program and every mode of baxter.sh: on standard output, with exit code 0, without a
master.

test_baxter_sh.py has the modes without a build.
"""
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from workspace_tree import ROOT, own_files, packages

pytestmark = pytest.mark.tree

INSTALLS = re.compile(r"\bPROGRAMS\s+(.*?)\s+DESTINATION", re.S)
#: A private parameter in a program's source.
PARAMETER = re.compile(r"""(?:get_param|has_param|wait_for_param|number|switch)\(\s*(?:get,\s*)?["'](~[a-z][a-z_]*)""")


def programs() -> list[str]:
    """Executables that the packages install, relative to the workspace."""
    found = []
    for name, folder in packages().items():
        text = (ROOT / folder / "CMakeLists.txt").read_text()
        words = {word for group in INSTALLS.findall(text) for word in group.split()}
        found += [str(folder / word.replace("${PROJECT_NAME}", name)) for word in words]
    return sorted(found)


def programs_of_modes() -> dict[str, str]:
    """{mode: its program} of the modes of baxter.sh that have one of Python's."""
    text = re.search(r"^declare -A PROGRAMS=\($(.*?)^\)$", (ROOT / "baxter.sh").read_text(), re.M | re.S)[1]
    commands = {mode: line.split() for mode, line in re.findall(r'\[([a-z-]+)\]="(.*)"', text)}
    return {mode: words[-1].replace("$LAB_ROOT/", "") if words[-1].startswith("$") else "-m" + words[-1]
            for mode, words in commands.items() if words[0] == "python3"}


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """{program: (exit code, standard output, standard error) of its --help}."""
    folder = tmp_path_factory.mktemp("help")
    command = [sys.executable, str(Path(__file__).with_name("help_of_programs.py")), str(folder)]
    # A port that nobody listens to.
    environment = {**os.environ, "ROS_MASTER_URI": "http://localhost:9", "ROS_HOSTNAME": "localhost", "COLUMNS": "100",
                   "DISPLAY": ""}
    called = [*programs(), *programs_of_modes().values()]
    done = subprocess.run([*command, *called], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return dict(zip(called, json.loads(done.stdout.splitlines()[-1]), strict=True))


def test_help_is_answered_without_a_master(answers):
    wrong = {program: answer for program, answer in answers.items()
             if (answer[0], answer[2]) != (0, "") or not re.search("usage|" + Path(program).name, answer[1])}
    assert len(answers) > 80 and not wrong


def test_help_names_the_parameters_that_a_program_reads(answers):
    missing = []
    for name, folder in packages().items():
        of_package = [program for program in answers if program.startswith(f"{folder}/")]
        told = "".join(answers[program][1] for program in of_package)
        sources = [ROOT / program for program in of_package] + sorted((ROOT / folder / "src").rglob("*.py"))
        read = {parameter for source in sources for parameter in PARAMETER.findall(source.read_text())}
        missing += [f"{name}: {parameter}" for parameter in sorted(read) if of_package and parameter not in told]
    assert not missing


def test_no_launch_file_asks_for_opengl_on_the_display():
    assert not [name for name in own_files() if name.endswith(".launch") and "OpenGL" in (ROOT / name).read_text()]
