# SPDX-License-Identifier: BSD-3-Clause
import sys

from .command import main

# Worker processes import this module again.
if __name__ == "__main__":
    sys.exit(main())
