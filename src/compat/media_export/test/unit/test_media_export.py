# SPDX-License-Identifier: BSD-3-Clause
"""rviz's query at its start gives no error line."""

import subprocess


def test_rvizs_question_is_answered_in_silence():
    done = subprocess.run(["rospack", "plugins", "--attrib=media_path", "media_export"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
