#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh doctor`: print every finding and its fix; exit code 0 when nothing is wrong."""

import os
import signal
import sys
from collections.abc import Iterable
from pathlib import Path

# It also runs where nothing has been built yet.
sys.path.append(str(Path(__file__).resolve().parents[1] / "src/base/master_calls/src"))

from lab_doctor.checks import Level, examine  # noqa: E402
from lab_doctor.probe import gather  # noqa: E402

# The questions of probe.gather, in the words of users.
QUESTIONS = {"python": "Python's imports", "topics": "messages of the robot", "master": "the ROS master",
             "move_group": "move_group",
             "is_fresh": "reading the packages", "listeners": "the list of open ports",
             "other_masters": "other ROS masters", "deaf_nodes": "the nodes' ports",
             "users_python": "your own Python", "own_packages": "your packages"}


def say_what_takes_long(names: Iterable[str]) -> None:
    named = ", ".join(QUESTIONS.get(name, "the " + name) for name in names)
    print(f"waiting for {named} ...", file=sys.stderr, flush=True)


def main() -> int:
    findings = examine(gather(Path(__file__).resolve().parent.parent, dict(os.environ), say_what_takes_long))
    for finding in findings:
        print(f"{finding.level.value:6}{finding.topic:11}{finding.what}")
        if finding.fix:
            print(f"{'':17}fix: {finding.fix}")
    wrong = sum(finding.level is Level.WRONG for finding in findings)
    busy = sum(finding.level is Level.BUSY for finding in findings)
    verdict = f"{wrong} wrong" if wrong else "Nothing is wrong"
    print(verdict + (f"; {busy} not checked." if busy else "."))
    return 1 if wrong else 0


if __name__ == "__main__":
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # a reader such as `head` may end first
    status = main()
    sys.stdout.flush()
    os._exit(status)  # a thread whose probe still hangs must not delay the exit
