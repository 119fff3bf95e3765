# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh labs`."""
import sys

from lab_class.command import main

if __name__ == "__main__":
    sys.exit(main())
