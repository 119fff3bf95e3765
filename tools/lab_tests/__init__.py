# SPDX-License-Identifier: BSD-3-Clause
"""The project's test runner: what `./baxter.sh test` finds, runs and counts. ROS-free; rostest runs as a process."""
