# SPDX-License-Identifier: BSD-3-Clause
"""The robot's serial is a part of file names, whatever the launch file was told."""
from pathlib import Path
from xml.etree import ElementTree

import pytest
from roslaunch.substitution_args import resolve_args

LAUNCH = Path(__file__).parents[2] / "launch/baxter_world.launch"


@pytest.mark.parametrize(("serial", "name"), [
    ("0", "SIM-BAXTER"), ("3", "SIM-BAXTER-3"), ("/home/me/own.yaml", "SIM-BAXTER-own"),
    ("own.yaml", "SIM-BAXTER-own")])
def test_the_manifest_names_the_robot(serial, name):
    parameter = ElementTree.parse(LAUNCH).find("param[@name='manifest/robot_serial']")
    assert resolve_args(parameter.get("value"), context={"arg": {"serial": serial}}) == name
