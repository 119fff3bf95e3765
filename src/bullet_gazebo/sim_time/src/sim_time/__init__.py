# SPDX-License-Identifier: BSD-3-Clause
"""Simulation time: when what happens at a rate is due, and the time stamps of messages."""
