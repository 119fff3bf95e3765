# SPDX-License-Identifier: BSD-3-Clause
"""Figures of a bench: collected round by round, then summarized as median, spread and ratio to a peer."""
import json
import statistics
from dataclasses import asdict, dataclass, field
from pathlib import Path

# Kinds of goals: for our figure, or for its ratio to the peer's. "least" is a lower bound, "most" an upper one.
GOALS = ("most", "least", "ratio_most", "ratio_least")


@dataclass
class Row:
    """One figure. ours, peer: one number per round; peer is empty if there is nothing to compare with. goal: {one of
    GOALS: bound}, or empty. samples: number of measurements behind each round's number, if known. pooled: the number is
    a share of its samples, and all rounds count as one: a miss in any of them is a miss."""

    suite: str
    what: str
    unit: str
    ours: list = field(default_factory=list)
    peer_name: str = ""
    peer: list = field(default_factory=list)
    goal: dict = field(default_factory=dict)
    samples: list = field(default_factory=list)
    pooled: bool = False

    @property
    def figure(self):
        """The figure's value: the share of all rounds' samples if they are pooled, else the median of the rounds."""
        if self.pooled:
            shares = zip(self.ours, self.samples, strict=True)
            return sum(share * count for share, count in shares) / sum(self.samples)
        return statistics.median(self.ours)

    @property
    def ratios(self):
        """Ratio of ours to the peer's, round by round: a disturbance in a round affects both."""
        return [ours / peer for ours, peer in zip(self.ours, self.peer, strict=False) if peer]

    @property
    def ratio(self):
        return statistics.median(self.ratios) if self.ratios else None

    @property
    def met(self):
        """Whether the figure keeps the goal; None without a goal, or without the peer that it needs."""
        for kind, bound in self.goal.items():
            value = self.ratio if kind.startswith("ratio") else self.figure
            if value is None:
                return None
            return value <= bound if kind.endswith("most") else value >= bound
        return None


class Report:
    """The measurements of one round of one suite."""

    def __init__(self):
        self.rows, self.samples = [], {}

    def add(self, what, ours, unit="", peer=None, samples=None, pooled=False, **goal):
        """Note a figure. ``peer``: (name, figure), measured in the same round. ``samples``: the number of measurements
        behind it. ``pooled``: it is a share of them, and all rounds count as one. ``goal``: one of GOALS."""
        if len(goal) > 1 or not set(goal) <= set(GOALS):
            raise ValueError("the goal must be one of %s, got %s" % (", ".join(GOALS), goal))
        if pooled and not samples:
            raise ValueError("a pooled share needs its number of samples, got %r for %s" % (samples, what))
        name, other = peer if peer is not None else ("", None)
        self.rows.append({"what": what, "unit": unit, "ours": float(ours), "peer_name": name,
                          "peer": None if other is None else float(other), "goal": goal, "samples": samples,
                          "pooled": pooled})

    def sample(self, title, unit, **values):
        """Note a distribution for the picture ``title``: {name: sequence of numbers}."""
        self.samples[title] = {"unit": unit,
                               "values": {name: [float(v) for v in some] for name, some in values.items()}}

    def save(self, path):
        Path(path).write_text(json.dumps({"rows": self.rows, "samples": self.samples}))


def put_together(suite, rounds):
    """Return (rows, samples) of the saved rounds of one suite: list of what :meth:`Report.save` wrote."""
    rows, samples = {}, {}
    for found in rounds:
        for entry in found["rows"]:
            row = rows.setdefault(entry["what"], Row(suite, entry["what"], entry["unit"], goal=entry["goal"],
                                                     peer_name=entry["peer_name"], pooled=entry["pooled"]))
            row.ours.append(entry["ours"])
            if entry["samples"] is not None:
                row.samples.append(entry["samples"])
            if entry["peer"] is not None:
                row.peer.append(entry["peer"])
        for title, entry in found["samples"].items():
            kept = samples.setdefault(title, {"unit": entry["unit"], "values": {}})
            for name, values in entry["values"].items():
                kept["values"].setdefault(name, []).extend(values)
    return list(rows.values()), samples


def table(rows):
    """Return the rows as lines of text, one figure each, its peer beside it."""
    lines = ["%-62s %11s %21s %8s  %-22s %11s %8s %15s  %s" % (
        "", "figure", "spread", "samples", "peer", "median", "ratio", "spread", "goal")]
    suite = None
    for row in rows:
        if row.suite != suite:
            suite = row.suite
            lines.append(suite)
        line = "  %-60s %11s %21s %8s" % (row.what + (" [%s]" % row.unit if row.unit else ""), number(row.figure),
                                          spread(row.ours), count(row))
        line += "  %-22s %11s %8s %15s" % (
            row.peer_name, number(statistics.median(row.peer)) if row.peer else "",
            number(row.ratio) if row.ratio is not None else "", spread(row.ratios) if row.ratios else "")
        lines.append((line + "  " + goal_text(row)).rstrip())
    return lines


def markdown(rows):
    """Return the rows as lines of a Markdown table."""
    lines = ["| figure | ours | spread | samples | peer | peer's | ratio | spread | goal |",
             "|---|---|---|---|---|---|---|---|---|"]
    suite = None
    for row in rows:
        if row.suite != suite:
            suite = row.suite
            lines.append("| **%s** | | | | | | | | |" % suite)
        lines.append("| %s | %s %s | %s | %s | %s | %s | %s | %s | %s |" % (
            row.what, number(row.figure), row.unit, spread(row.ours), count(row), row.peer_name,
            number(statistics.median(row.peer)) if row.peer else "", number(row.ratio) if row.ratio is not None else "",
            spread(row.ratios) if row.ratios else "", goal_text(row)))
    return lines


def count(row):
    """Number of measurements of all rounds together; empty if they were not counted."""
    return number(sum(row.samples)) if row.samples else ""


def goal_text(row):
    """The goal in words, and whether the figure meets it."""
    for kind, bound in row.goal.items():
        sign = "<=" if kind.endswith("most") else ">="
        verdict = {None: "no peer", True: "yes", False: "NO"}[row.met]
        return "%s%s %s: %s" % ("ratio " if kind.startswith("ratio") else "", sign, number(bound), verdict)
    return ""


def spread(values):
    """Least and greatest of the rounds."""
    return "%s to %s" % (number(min(values)), number(max(values))) if len(values) > 1 else ""


def number(value):
    """Four significant digits, without an exponent, so that the table is easy to read."""
    if value is None:
        return ""
    if value == int(value) and abs(value) < 1e6:
        return "%d" % value
    if abs(value) >= 1000:
        return "%.0f" % value
    # 99.99 % must not be rounded to 100 %.
    return "%.2f" % value if abs(value) >= 10 else "%.3f" % value if abs(value) >= 0.1 else "%.4g" % value


def as_json(rows, samples, machine):
    """Return the data for the JSON file."""
    return json.dumps({"machine": machine, "rows": [{**asdict(row), "figure": row.figure, "ratio": row.ratio,
                                                     "met": row.met} for row in rows], "samples": samples}, indent=1)
