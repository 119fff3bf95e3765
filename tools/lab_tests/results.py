# SPDX-License-Identifier: BSD-3-Clause
"""Counting: what JUnit files say, summed over every layer of tests."""

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree


@dataclass
class Tally:
    """Tests passed, failed and skipped; details holds one text for each failure."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    details: list[str] = field(default_factory=list)

    def add(self, other: "Tally"):
        self.passed += other.passed
        self.failed += other.failed
        self.skipped += other.skipped
        self.details += other.details

    @property
    def total(self) -> int:
        return self.passed + self.failed + self.skipped


def failure(detail: str) -> Tally:
    """One failed test that no JUnit file knows of: a crash, a timeout, a process left behind."""
    return Tally(failed=1, details=[detail])


def read_junit(path: Path) -> Tally:
    """The test cases of one JUnit file; a file that is not XML counts as one failure (its writer died)."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        return failure(f"{path.name}: unreadable test results: {error}")
    tally = Tally()
    for case in root.iter("testcase"):
        problems = [child for child in case if child.tag in ("failure", "error")]
        if problems:
            tally.failed += 1
            name = f"{case.get('classname', '')}.{case.get('name', '')}"
            texts = [(child.get("message") or "") + "\n" + (child.text or "") for child in problems]
            tally.details.append("\n".join([name, *texts]).strip())
        elif case.find("skipped") is not None:
            tally.skipped += 1
        else:
            tally.passed += 1
    return tally


def read_rostest_results(folder: Path) -> Tally:
    """Results of one .test file, from rostest's result folder.

    rostest writes a file of its own, `rostest-*.xml`, in which a case says whether a test node ran to its end, and each
    test node writes its own cases. Only the latter count as tests; the former count where they failed (a crash).
    No test at all is a failure.
    """
    tally = Tally()
    for path in sorted(folder.rglob("*.xml")):
        one = read_junit(path)
        if path.name.startswith("rostest-"):
            one.passed = one.skipped = 0
        tally.add(one)
    if tally.total == 0:
        return failure("rostest found no test in this file, or none of its test nodes wrote results")
    return tally
