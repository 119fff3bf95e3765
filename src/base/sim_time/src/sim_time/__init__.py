# SPDX-License-Identifier: BSD-3-Clause
"""Simulation time: when periodic work is due, and the time stamps of messages."""
