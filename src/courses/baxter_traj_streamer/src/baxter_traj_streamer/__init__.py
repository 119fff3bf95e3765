# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories for the arms of Baxter: checked, timed, streamed."""
