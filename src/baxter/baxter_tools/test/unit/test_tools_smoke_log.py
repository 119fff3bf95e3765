# SPDX-License-Identifier: BSD-3-Clause
"""The name of the smoke test's log file."""
import datetime

from baxter_tools.smoke_tests import TESTS, log_file_name


def test_name_of_the_log():
    assert log_file_name("SIM-BAXTER", "1.2.0.57", datetime.datetime(2026, 3, 9)) == (
        "SIM-BAXTER-3.9.2026-rsdk-1.2.0.57.smoketest")


def test_a_serial_number_does_not_lead_to_another_folder():
    assert "/" not in log_file_name("../x", "1.2.0", datetime.datetime(2026, 3, 9))


def test_every_test_says_what_it_tests():
    assert all(test.__doc__ for test in TESTS.values())
