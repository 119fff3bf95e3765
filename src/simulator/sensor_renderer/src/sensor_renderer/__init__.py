# SPDX-License-Identifier: BSD-3-Clause
"""Cameras and depth cameras of the simulated world, drawn from the simulator's snapshot."""
