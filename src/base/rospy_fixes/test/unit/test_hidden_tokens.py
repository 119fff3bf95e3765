# SPDX-License-Identifier: BSD-3-Clause
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rospy_fixes.hidden_tokens import hidden, hide_in_logs

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))


@pytest.mark.parametrize("text", [
    "GET /snapshot?topic=/a&token=s3cret&page=1 (127.0.0.1)", "uri='/?token=s3cret', version='HTTP/1.1'",
    "{'Authorization': 'Bearer s3cret'}", "Cookie: lab_token=s3cret; x", "{'view_token': 's3cret'}",
    "lab_web --port 8090 --view-token s3cret", '"token": "s3cret"', "{'token': [b's3cret']}",
    "environ({'LAB_WEB_TOKEN': 's3cret', 'HOME': '/home/a'})", "['rosbridge_websocket.launch', 'token:=s3cret']",
    " * /rosbridge_websocket/token: s3cret"])
def test_no_log_has_a_token_in_it(text, caplog):
    hide_in_logs()
    hide_in_logs()
    log = logging.getLogger("tornado.application")
    log.warning("%s failed", text)
    try:
        raise ValueError(text)
    except ValueError:
        log.exception("a request")
    assert "s3cret" not in caplog.text and "…" in caplog.text and "ValueError" in caplog.text


def test_a_text_without_tokens_is_as_it_was(caplog):
    hide_in_logs()
    logging.getLogger("x").warning("the token is wrong: %d of %s", 3, "a=b")
    assert "the token is wrong: 3 of a=b" in caplog.text
    assert hidden("token: \n * /a/port: 9090") == "token: \n * /a/port: 9090"


def test_roslaunch_logs_and_shows_no_token(tmp_path):
    launch = tmp_path / "a.launch"
    launch.write_text('<launch><arg name="token"/><param name="token" value="$(arg token)" type="str"/>'
                      '<param name="port" value="9090"/></launch>')
    program = ("import roslaunch.core, roslaunch.config, roslaunch.rlutil, rosgraph.roslogging, os, sys\n"
               "rosgraph.roslogging.configure_logging('roslaunch', filename='launch.log')\n"
               "import logging; logging.getLogger('roslaunch').info('starting with %s, %s', sys.argv, os.environ)\n"
               "config = roslaunch.config.load_config_default([sys.argv[1]], None, verbose=False)\n"
               "print(config.summary())")
    done = subprocess.run(
        [sys.executable, "-c", program, str(launch), "token:=s3cret"], capture_output=True, text=True,
        env={"PYTHONPATH": OURS, "PATH": os.environ["PATH"], "ROS_LOG_DIR": str(tmp_path), "HOME": str(tmp_path),
             "LAB_WEB_TOKEN": "s3cret", "ROS_MASTER_URI": "http://localhost:11311"})
    assert "/token: …" in done.stdout and "9090" in done.stdout, done.stderr
    log = (tmp_path / "launch.log").read_text()
    assert "LAB_WEB_TOKEN" in log and "s3cret" not in log + done.stdout


def test_users_programs_log_what_they_like(tmp_path):
    program = "import logging, rosgraph.roslogging; logging.basicConfig(); logging.warning('token: %d', 3)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                          env={"PYTHONPATH": OURS, "PATH": os.environ["PATH"], "HOME": str(tmp_path)})
    assert "token: 3" in done.stderr
