#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The name that launch files older than ROS melodic give the ``xacro`` command."""
import os
import sys

# Python searches a script's folder for modules first, and xacro.py is there.
HERE = os.path.dirname(os.path.realpath(__file__))
sys.path[:] = [folder for folder in sys.path if os.path.realpath(folder) != HERE]

from xacro import main  # noqa: E402

if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:  # where it was in the file is of no use to anyone
        sys.exit(130)
