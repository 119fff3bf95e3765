# SPDX-License-Identifier: BSD-3-Clause
"""The data card of a set: README.md in its folder, which says to people what the set is, with the head that model hubs
read."""
from __future__ import annotations

from pathlib import Path

import numpy as np

from . import layout
from .frames import CONDITIONS, EXPERT_ACTION
from .reading import DataSet

NAME = "README.md"
_HEAD = """---
task_categories: [robotics]
tags: [LeRobot, baxter]
configs:
- config_name: default
  data_files: data/*/*.parquet
---
"""


def card(data: DataSet) -> str:
    """The card's text. Raises DemonstrationError where an episode cannot be read."""
    episodes = [data.episode(number) for number in range(len(data))]
    lengths = np.array([len(episode) for episode in episodes] or [0])
    schema, about = data.schema, data.schema.about
    # Rows of a table must not end within a task's words.
    tasks = [task.replace("|", "/") for task in data.tasks]
    rows = [
        ("shown", "; ".join(tasks)),
        ("where", "on a robot of ROS" if about.get("control") == "positions" else
         "in the environment %s of gym_baxter, simulated" % about.get("task", "?")),
        ("actions", str(about.get("control", "?"))),
        *((key, "; ".join("%s %s" % item for item in value.items()) if isinstance(value, dict) else str(value))
          for key in CONDITIONS if (value := about.get(key))),
        ("episodes", "%d, of which %d are successes" % (len(episodes), sum(one.success for one in episodes))),
        ("frames", "%d at %d Hz; an episode has %d to %d, the median is %g" % (
            lengths.sum(), schema.rate_hz, lengths.min(), lengths.max(), np.median(lengths))),
        ("seeds", _seeds(data))]
    text = "# Demonstrations of Baxter\n\nA LeRobot data set, format %s.\n\n| | |\n|---|---|\n" % layout.VERSION
    text += "".join("| %s | %s |\n" % row for row in rows)
    text += "\n| feature | size | unit of each number |\n|---|---|---|\n"
    for key, feature in schema.features.items():
        units = sorted(set(feature.units or ()) - {""})
        text += "| `%s` | %s | %s |\n" % (key, " x ".join(map(str, feature.shape)), ", ".join(units) or "-")
    if EXPERT_ACTION in schema.features:
        text += ("\nThe actions were disturbed, or a policy's, in part of the time: learn from `%s`, replay `action`.\n"
                 % EXPERT_ACTION)
    return _HEAD + text + ("\n`meta/baxter.json` has the units by number, `meta/baxter_episodes.jsonl` seed and "
                           "success of each episode.\n")


def _seeds(data):
    seeds = [seed for seed in data.seeds if seed is not None]
    return "%d to %d" % (min(seeds), max(seeds)) if seeds else "none: it cannot begin again by itself"


def write_card(folder: Path) -> Path:
    """Write the card into a set's folder; returns its file. Raises DemonstrationError, OSError."""
    text = card(DataSet(folder))
    layout.write_whole(folder / NAME, lambda draft: draft.write_text(text, encoding="utf-8"))
    return folder / NAME
