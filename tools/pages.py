#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Make the tables of the pages in docs/ from the data in docs/data.

    ./baxter.sh sim tools/pages.py                                     # write the tables
    ./baxter.sh sim tools/pages.py --take .baxter/bench/bench.json NAME  # first take the figures of a bench: run NAME

A table stands in a page between two comments, of which the first names file, rows and columns:

    <!-- table of data/performance.csv, part = ik: figure, here, goal -->
    <!-- end of table -->

`, part = ik` is left out where all rows are shown. In the file of figures a row's `bench` is `suite: figure` of the
bench. NAME, with date, machine and command, is added to docs/data/runs.csv.
"""
from __future__ import annotations

import argparse
import csv
import json
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[1] / "docs"
TABLE = re.compile(r"(<!-- table of (\S+?)(?:, (\w+) = (.*?))?: (.*?) -->\n).*?(<!-- end of table -->)", re.DOTALL)
FIGURES, RUNS = DOCS / "data/performance.csv", DOCS / "data/runs.csv"


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file. Raises ValueError for a row with more or fewer cells than the head."""
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file, strict=True)
        rows = list(reader)
    for number, row in enumerate(rows, 1):
        if None in row or None in row.values():
            raise ValueError(f"{path}, row {number}: expected {len(reader.fieldnames or ())} cells: "
                             + ", ".join(filter(None, reader.fieldnames or ())))
    return rows


def write_rows(path: Path, rows: list[dict[str, str]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def with_tables(text: str, folder: Path) -> str:
    """The text of a page, its tables made from files below ``folder``. Raises ValueError if a table has no rows, and
    KeyError if a file has no such column."""
    def made(match: re.Match[str]) -> str:
        head, name, key, value, columns, end = match.groups()
        shown = columns.split(", ")
        rows = [row for row in rows_of(folder / name) if key is None or row[key] == value]
        if not rows:
            raise ValueError(f"{name} has no row whose {key} is {value!r}")
        lines = [" | ".join(shown), "|".join(["---"] * len(shown)),
                 *(" | ".join(row[column] for column in shown) for row in rows)]
        return head + "".join(f"|{line}|\n" if line.startswith("---") else f"| {line} |\n" for line in lines) + end
    return TABLE.sub(made, text)


def number(value: float) -> str:
    """Three significant digits, without an exponent; 99.99 % stays."""
    return f"{value:.2f}" if 99 < value < 100 else f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def figure(row: dict[str, Any]) -> dict[str, str]:
    """Cells of the page's row for a row of bench.json."""
    beside, goal = row["peer_name"], ""
    if row["ratio"] is not None:
        beside += f": {number(row['ratio'])} times"
    for kind, bound in row["goal"].items():
        goal = f"{number(bound)} times" if kind.startswith("ratio") else f"{number(bound)} {row['unit']}".strip()
    if row["met"] is False:
        goal += ": **not kept**"
    return {"here": f"{number(row['figure'])} {row['unit']}".strip(), "beside": beside, "goal": goal}


def take(bench: dict[str, Any], run: str, figures: list[dict[str, str]], runs: list[dict[str, str]]) -> list[str]:
    """Put the figures of a bench into the rows that have them, and the run into ``runs``. Returns the bench's figures
    that no row shows. Raises ValueError for a quick bench and for the name of another run."""
    if any(row["run"] == run for row in runs):
        raise ValueError(f"docs/data/runs.csv has a run {run!r} already; choose another name")
    if bench["machine"]["quick"]:
        raise ValueError("the figures of a quick bench mean nothing: run it without --quick")
    found = {f"{row['suite']}: {row['what']}": row for row in bench["rows"]}
    for row in figures:
        if row["bench"] in found:
            row.update(figure(found.pop(row["bench"])), run=run)
    machine, suites = bench["machine"], sorted({row["suite"] for row in bench["rows"]})
    runs.append({"run": run, "date": machine["date"].split()[0],
                 "machine": f"{machine['cpu']}, {machine['cores']} cores, load {machine['load_before'].split()[0]}",
                 "command": f"`bench {' '.join(suites)} --rounds {machine['rounds']}`"})
    shown = {row["run"] for row in figures}
    runs[:] = [row for row in runs if row["run"] in shown]
    return sorted(found)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--take", nargs=2, metavar=("FILE", "NAME"), help="take the figures of a bench")
    options = parser.parse_args()
    if options.take:
        figures, runs = rows_of(FIGURES), rows_of(RUNS)
        try:
            left = take(json.loads(Path(options.take[0]).read_text(encoding="utf-8")), options.take[1], figures, runs)
        except (OSError, ValueError) as error:
            parser.error(str(error))
        write_rows(FIGURES, figures)
        write_rows(RUNS, runs)
        print("not on the page:", *left, sep="\n  ")
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := with_tables(text, DOCS)) != text:
            page.write_text(new, encoding="utf-8")
            print("written:", page.relative_to(DOCS.parent))
    return 0


if __name__ == "__main__":
    sys.exit(main())
