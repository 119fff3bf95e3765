# SPDX-License-Identifier: BSD-3-Clause
"""The words of `./baxter.sh labs`."""
from lab_class import command


def test_a_launch_file_of_this_folder_is_found_from_another(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.launch").write_text("<launch/>", encoding="utf-8")
    assert command._launch("mine.launch pose:=tucked") == (str(tmp_path.resolve() / "mine.launch"), "pose:=tucked")
    assert command._launch("baxter_gazebo baxter_world.launch") == ("baxter_gazebo", "baxter_world.launch")
