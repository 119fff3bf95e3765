# SPDX-License-Identifier: BSD-3-Clause
"""`python3 -P -m rf_grading`, which `./baxter.sh grade` runs."""
import sys

from rf_grading.command import main

# Workers import this module again.
if __name__ == "__main__":
    sys.exit(main())
