# SPDX-License-Identifier: BSD-3-Clause
"""The folders in the lab sheets exist, also the one that they spell in two ways."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BAXTER = ROOT / "src" / "baxter"
VENDOR_PACKAGES = ("baxter_core_msgs", "baxter_description", "baxter_maintenance_msgs", "rethink_ee_description")


@pytest.mark.parametrize("package", VENDOR_PACKAGES)
def test_the_other_spelling_leads_to_the_same_package(package):
    other = BAXTER / "common" / package
    assert (other / "package.xml").is_file()
    assert other.resolve() == (BAXTER / "baxter_common" / package).resolve()


def test_catkin_finds_no_package_twice():
    assert (BAXTER / "common" / "CATKIN_IGNORE").is_file()


def test_the_workspaces_own_tests_are_a_package():
    assert (ROOT / "src" / "workspace_tests" / "package.xml").samefile(ROOT / "tests" / "package.xml")
