# SPDX-License-Identifier: BSD-3-Clause
"""The topics in the configurations of rviz are those that the panel publishes."""
from pathlib import Path

import pytest
import rospkg
import yaml

from motion_planning_rviz.handles import TOPIC
from motion_planning_rviz.view import FILM, PICTURES


@pytest.mark.parametrize("package, file", [("probot_anno_moveit_config", "config/arm.rviz"),
                                           ("baxter_moveit_config", "launch/moveit.rviz")])
def test_rviz_shows_all_of_it(package, file):
    path = Path(rospkg.RosPack().get_path(package)) / file
    displays = yaml.safe_load(path.read_text())["Visualization Manager"]["Displays"]
    shown = {display["Marker Topic"] for display in displays if display["Class"] == "rviz/MarkerArray"}
    assert {"/planning_panel/" + name for name in (*PICTURES, FILM)} <= shown
    assert [display["Update Topic"] for display in displays if display["Class"] == "rviz/InteractiveMarkers"] == [
        TOPIC + "/update"]
    assert all(display["Enabled"] for display in displays if display["Class"] in (
        "rviz/MarkerArray", "rviz/InteractiveMarkers"))
