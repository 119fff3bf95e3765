#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh doctor`: print every finding and its fix; exit code 0 when nothing is wrong."""

import os
import sys
from pathlib import Path

from lab_doctor.checks import Level, examine
from lab_doctor.probe import gather


def main() -> int:
    findings = examine(gather(Path(__file__).resolve().parent.parent, dict(os.environ)))
    for finding in findings:
        print(f"{finding.level.value:6}{finding.topic:11}{finding.what}")
        if finding.fix:
            print(f"{'':17}fix: {finding.fix}")
    wrong = sum(finding.level is Level.WRONG for finding in findings)
    print("Nothing is wrong." if not wrong else f"{wrong} wrong.")
    return 1 if wrong else 0


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)  # a probe that still hangs, in a thread, must not keep us
