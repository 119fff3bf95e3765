# SPDX-License-Identifier: BSD-3-Clause
import sys
from pathlib import Path

# For `lerobot_stand_ins`, and for the plugins, which are packages of their own.
PLUGINS = (Path(__file__).parents[2] / "lerobot_plugins").glob("lerobot_*")
sys.path[:0] = [str(Path(__file__).parent), *map(str, PLUGINS)]
