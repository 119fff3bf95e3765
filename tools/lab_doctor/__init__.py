# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh doctor`: facts about the lab (probe.py), findings and their fixes (checks.py). Imports no ROS."""
