# SPDX-License-Identifier: BSD-3-Clause
"""rostest, with the time limits of its tests and nodes multiplied by LAB_TEST_STRETCH."""

import os

import roslaunch.core
import roslaunch.xmlloader
from rostest import rostestmain


class StretchedTest(roslaunch.core.Test):
    """A test node with a longer time limit than in its file."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.time_limit *= float(os.environ["LAB_TEST_STRETCH"])


if __name__ == "__main__":
    # Before any file is read: the loader makes its tests by this name.
    roslaunch.xmlloader.Test = StretchedTest
    rostestmain()
