# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh doctor`: facts about the lab (probe.py), what is wrong and the fix (checks.py). Imports no ROS."""
