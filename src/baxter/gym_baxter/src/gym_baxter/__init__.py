# SPDX-License-Identifier: BSD-3-Clause
"""Environments for learning with Baxter. ``import gym_baxter`` makes them known to Gymnasium where it is installed;
`core.Core` needs no Gymnasium."""
import importlib.util

if importlib.util.find_spec("gymnasium") is not None:
    from .env import register

    register()
