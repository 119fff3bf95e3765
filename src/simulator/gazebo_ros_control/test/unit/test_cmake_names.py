# SPDX-License-Identifier: BSD-3-Clause
"""Packages that ask CMake for ros_control's or Gazebo's C++ packages are configured."""
import re
import shutil
import subprocess
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2]
SCRIPT = """set(CMAKE_PREFIX_PATH "%s")
foreach(name %s)
  find_package(${name} REQUIRED NO_MODULE)
  message(STATUS "${name}: ${${name}_FOUND} ${${name}_FOUND_CATKIN_PROJECT} '${${name}_INCLUDE_DIRS}'")
endforeach()
"""


def test_names_are_found_as_packages_of_catkin_without_headers(tmp_path):
    names = re.search(r"foreach\(NAME(.*?)\)", (PACKAGE / "CMakeLists.txt").read_text(), re.DOTALL)[1].split()
    assert {"gazebo", "gazebo_dev", "controller_interface", "hardware_interface", "effort_controllers",
            "position_controllers", "velocity_controllers", "joint_trajectory_controller",
            "diff_drive_controller"} <= set(names)
    for name in names:
        folder = tmp_path / "share" / name / "cmake"
        folder.mkdir(parents=True)
        shutil.copy(PACKAGE / "cmake" / "nameConfig.cmake", folder / (name + "Config.cmake"))
    script = tmp_path / "find.cmake"
    script.write_text(SCRIPT % (tmp_path, " ".join(names)))
    done = subprocess.run(["cmake", "-P", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    for name in names:
        assert "-- %s: 1 TRUE ''" % name in done.stdout
