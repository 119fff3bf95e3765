# SPDX-License-Identifier: BSD-3-Clause
"""The renderer that a simulator starts for itself."""
import sys

import pytest

from gazebo_ros.picture_process import PictureProcess
from lab_testing.waiting import wait_until

UNTIL_INPUT_ENDS = [sys.executable, "-c", "import sys; open(sys.argv[1], 'a').write('begun '); sys.stdin.read()"]
FAILS = [sys.executable, "-c", "import sys; open(sys.argv[1], 'a').write('begun '); sys.exit(3)"]


class Log(list):
    def info(self, text):
        self.append(text)

    warn = info


@pytest.fixture
def started(tmp_path):
    made = []

    def start(command, runs_already=lambda: False, restart_s=0.0):
        file, log = tmp_path / "begun", Log()
        file.write_text("")
        made.append(PictureProcess([*command, str(file)], runs_already, log, restart_s))
        return made[-1], file, log

    yield start
    for process in made:
        process.close()


def test_it_starts_once_there_is_a_camera_and_ends_with_the_simulator(started):
    pictures, file, log = started(UNTIL_INPUT_ENDS)
    assert file.read_text() == "" and not log
    pictures.want()
    pictures.want()
    wait_until(lambda: file.read_text() == "begun ", timeout_s=20.0)
    pictures.close()
    pictures.want()
    assert file.read_text() == "begun " and len(log) == 1


def test_one_that_fails_is_started_again(started):
    pictures, file, log = started(FAILS)
    pictures.want()
    wait_until(lambda: file.read_text().count("begun") >= 3, timeout_s=20.0)
    assert any("ended with code 3" in line for line in log)


def test_where_a_renderer_runs_already_none_is_started(started):
    asked = []
    pictures, file, log = started(UNTIL_INPUT_ENDS, lambda: not asked.append(True))
    pictures.want()
    wait_until(lambda: asked, timeout_s=20.0)
    pictures.close()
    assert file.read_text() == "" and not log


def test_a_program_that_is_not_there_is_one_warning(started):
    pictures, _, log = started(["/no/such/program"])
    pictures.want()
    wait_until(lambda: any("no pictures" in line for line in log), timeout_s=20.0)
