# SPDX-License-Identifier: BSD-3-Clause
"""The nodes' settings, read without ROS."""
import pathlib

import yaml

from baxter_traj_streamer.settings import StreamerSettings

_PACKAGE = pathlib.Path(__file__).resolve().parents[1]


def read(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


DEFAULTS, AS_IN_NOTES = (read(_PACKAGE / "config" / name) for name in ("streamer.yaml", "as_in_notes.yaml"))


def make_settings(**overrides):
    return StreamerSettings(DEFAULTS, overrides)
