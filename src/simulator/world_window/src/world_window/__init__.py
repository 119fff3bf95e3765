# SPDX-License-Identifier: BSD-3-Clause
"""The simulator's window: shows the world by the cameras' renderer, and lets the user look around, pull and pause."""
