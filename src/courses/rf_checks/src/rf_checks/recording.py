# SPDX-License-Identifier: BSD-3-Clause
"""The record of a program's run, as plain data. Free of ROS."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from baxter_model import SIDES, joint_names

RECORD_S = 0.01
#: A box in move_group's scene: name, pose (4, 4), edges (3,) [m].
Box = tuple[str, np.ndarray, np.ndarray]


class RunRecording:
    """The robot's motion: one record (a dict as recorder.py writes it) each RECORD_S of simulation."""

    def __init__(self, joint_names: Iterable[str], records: Iterable[dict[str, Any]] = ()) -> None:
        self.joint_names = tuple(joint_names)
        self.records = list(records)

    @cached_property
    def times(self) -> np.ndarray:
        """(n,) [s]."""
        return np.array([record["t"] for record in self.records])

    @cached_property
    def positions(self) -> np.ndarray:
        """(n, joints) [rad, m], columns in the order of joint_names."""
        return np.array([record["q"] for record in self.records]).reshape(len(self.records), len(self.joint_names))

    def arm(self, side: str) -> np.ndarray:
        """(n, 7) [rad]: one arm's joints from shoulder to wrist."""
        return self.positions[:, [self.joint_names.index(name) for name in joint_names(side)]]

    def joints_at(self, row: int) -> dict[str, float]:
        """Joint values of one record: dict of name to rad or m. Negative rows count from the end."""
        return dict(zip(self.joint_names, self.records[row]["q"], strict=True))

    def was_enabled(self) -> bool:
        """Whether the robot was ever enabled."""
        return any(record["enabled"] for record in self.records)

    def held(self, side: str) -> tuple[int, list[str]] | None:
        """(row, names) of the last record in which collision avoidance held an arm away from these links, or None."""
        rows = [row for row, record in enumerate(self.records) if record["held"].get(side)]
        return (rows[-1], self.records[rows[-1]]["held"][side]) if rows else None

    def contacts(self) -> list[tuple[str, str]]:
        """Pairs of links that started to touch; those of the first record do not count."""
        first = {tuple(pair) for pair in self.records[0]["contacts"]} if self.records else set()
        return sorted({tuple(pair) for record in self.records for pair in record["contacts"]} - first)

    def commands(self) -> list[tuple[str, int, list[str], list[float]]]:
        """The recorded joint commands: list of (side, mode, names, values)."""
        return [tuple(command[:4]) for record in self.records for command in record["commands"]]

    def commanders(self) -> list[tuple[str, str, int]]:
        """The nodes that commanded the arms: sorted (node name, side, mode) of accepted commands."""
        return sorted({(command[4], command[0], command[1]) for record in self.records
                       for command in record["commands"] if command[5]})

    def accepted_count(self, side: str) -> int:
        """Number of accepted joint commands of one arm since the start."""
        return self.records[-1]["accepted"][side] - self.records[0]["accepted"][side] if self.records else 0

    def placed_count(self) -> int:
        """How often a service or a reset moved the joints."""
        return self.records[-1]["placed"] - self.records[0]["placed"] if self.records else 0

    def path_without_cause(self) -> float:
        """Path length of the joint that moved most [rad] before any command was accepted."""
        first = self.records[0]["accepted"] if self.records else {}
        rows = next((row for row, record in enumerate(self.records) if record["accepted"] != first), len(self.records))
        arms = np.hstack([self.arm(side)[:rows] for side in SIDES])
        return float(np.abs(np.diff(arms, axis=0)).sum(axis=0).max()) if rows > 1 else 0.0

    def command_counts(self) -> np.ndarray:
        """(n, 2): number of joint commands until then, left and right, since the start."""
        counts = np.array([[record["counts"][side] for side in SIDES] for record in self.records]).reshape(-1, 2)
        return counts - counts[0] if len(counts) else counts

    def ik_requests(self) -> list[tuple[Any, ...]]:
        """Requested poses of the IK service: list of (side, frame, xyz, xyzw, verdict)."""
        return [tuple(request) for record in self.records for request in record["ik"]]

    def scenes(self) -> list[tuple[int, list[Box]]]:
        """The boxes in move_group's scene, each time they changed, and the number of the record."""
        return [(row, [(name, np.array(pose).reshape(4, 4), np.array(edges)) for name, pose, edges in record["scene"]])
                for row, record in enumerate(self.records) if "scene" in record]


@dataclass(frozen=True)
class GraphChanges:
    """Changes of the lab's own registrations. All names sorted.

    missing_nodes: ended, or no longer registered. intruders: dict of the lab's topics to other nodes that publish them.
    withdrawn: lost publications, subscriptions and services of the lab's nodes. parameters: changed or deleted.
    """

    missing_nodes: list[str] = field(default_factory=list)
    intruders: dict[str, list[str]] = field(default_factory=dict)
    withdrawn: list[str] = field(default_factory=list)
    parameters: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.missing_nodes or self.intruders or self.withdrawn or self.parameters)


@dataclass
class ProgramRun:
    """One run of a program.

    ended: how the run ended: "exited", "satisfied" (the judge had seen enough), "sim time", "busy", "flood",
    "output", "processes", "threads", "sockets", "files", "memory", "paused", "simulator gone", "meddled", "requests".
    changes: GraphChanges of the lab. stuck_at: the program's line when the judge ended it. cpu_s: its processor time;
    wall_s: its wall time.
    """

    arguments: list[str]
    recording: RunRecording
    output: str = ""
    errors: str = ""
    exit_code: int | None = None
    ended: str = "exited"
    stuck_at: int | None = None
    survivors: int = 0
    changes: GraphChanges = GraphChanges()
    program: str = ""
    cpu_s: float = 0.0
    wall_s: float = 0.0

    @property
    def simulated_s(self) -> float:
        """Simulated time of the run [s]."""
        return len(self.recording.records) * RECORD_S


@dataclass(frozen=True)
class Criterion:
    """One criterion: achieved share (0 to 1), weight (points of 100), and a text about the result."""

    name: str
    share: float
    weight: float
    found: str


@dataclass(frozen=True)
class RunFault:
    """A fault: a short key, and the sentence for the author. cap: largest share of all points."""

    key: str
    sentence: str
    cap: float = 1.0
