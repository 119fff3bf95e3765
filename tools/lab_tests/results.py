# SPDX-License-Identifier: BSD-3-Clause
"""Counts the results of JUnit files over all layers of tests, and the tests that did not run."""
import collections
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

# pytest's text for a skip without a reason.
BARE = ("", "unconditional skip")
# The failures are told once more at the end, where often only the end of a long log is kept: so many, each
# with so many characters of its beginning.
TOLD_FAILURES = 20
TOLD_CHARACTERS = 1200


@dataclass
class Tally:
    """Tests passed and failed, and those that did not run.

    details: one text per failure, its first line the test's name; skips: (test, reason) of skipped tests; long: the
    long tests left out.
    """

    passed: int = 0
    failed: int = 0
    details: list[str] = field(default_factory=list)
    skips: list[tuple[str, str]] = field(default_factory=list)
    long: list[str] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        self.passed += other.passed
        self.failed += other.failed
        self.details += other.details
        self.skips += other.skips
        self.long += other.long

    def refuse_bare_skips(self) -> None:
        """Count skips without a reason as failures."""
        for name, reason in self.skips:
            if reason in BARE:
                self.add(failure(f"{name}: skipped without a reason; name what this machine lacks"))
        self.skips = [skip for skip in self.skips if skip[1] not in BARE]

    @property
    def skipped(self) -> int:
        return len(self.skips)

    @property
    def total(self) -> int:
        return self.passed + self.failed + self.skipped


def summary(tally: Tally) -> str:
    """The last printed line. The text up to `failed` must not change: continuous integration parses it."""
    counts = f"{tally.passed} passed, {tally.failed} failed, {tally.skipped} skipped, {len(tally.long)} long not run"
    return "\n".join([*_not_run(tally), *_failures(tally), counts])


def _failures(tally):
    if tally.details:
        yield "failed:"
    for detail in tally.details[:TOLD_FAILURES]:
        told = detail if len(detail) <= TOLD_CHARACTERS else f"{detail[:TOLD_CHARACTERS]} ..."
        yield from (f"    {line}" for line in told.splitlines())
    if len(tally.details) > TOLD_FAILURES:
        yield f"    and {len(tally.details) - TOLD_FAILURES} more"


def _not_run(tally):
    by_reason = {}
    for name, reason in tally.skips:
        by_reason.setdefault(reason, []).append(name)
    for reason, names in by_reason.items():
        yield f"skipped: {reason}"
        yield from (f"    {name}" for name in dict.fromkeys(names))
    if tally.long:
        by_file = collections.Counter(name.partition("::")[0] for name in tally.long)
        yield "long, not run (--long, or by name):"
        yield from (f"    {file}{f', {count} tests' if count > 1 else ''}" for file, count in sorted(by_file.items()))


def failure(detail: str) -> Tally:
    """One failed test that is in no JUnit file: a crash, a timeout, a process left behind."""
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
        name = f"{case.get('classname', '')}.{case.get('name', '')}"
        skip = case.find("skipped")
        if problems:
            tally.failed += 1
            texts = [(child.get("message") or "") + "\n" + (child.text or "") for child in problems]
            tally.details.append("\n".join([name, *texts]).strip())
        elif skip is not None:
            tally.skips.append((name, " ".join((skip.get("message") or "").split())))
        else:
            tally.passed += 1
    return tally


def read_rostest_results(folder: Path) -> Tally:
    """Results of one .test file, from rostest's result folder.

    rostest writes a file of its own, `rostest-*.xml`, in which a case says whether a test node ran to its end, and each
    test node writes its own cases. Only the latter count as tests; the former count where they failed (a crash).
    rosunit has no skips: it counts a skipped test as passed. `lab_testing.skipping` writes a `skipped-*.xml` beside it.
    No test at all is a failure.
    """
    tally = Tally()
    for path in sorted(folder.rglob("*.xml")):
        one = read_junit(path)
        if path.name.startswith("rostest-"):
            one.passed, one.skips = 0, []
        if path.name.startswith("skipped-"):
            one.passed -= one.skipped
        tally.add(one)
    if tally.total == 0:
        return failure("rostest found no test in this file, or none of its test nodes wrote results")
    return tally
