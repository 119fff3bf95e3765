# SPDX-License-Identifier: BSD-3-Clause
"""The project's test runner: finds, runs and counts the tests of `./baxter.sh test`. ROS-free; rostest runs as a
process."""
