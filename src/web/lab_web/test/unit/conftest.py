# SPDX-License-Identifier: BSD-3-Clause
import sys
from pathlib import Path

# lab_arms is shared by files of this folder.
sys.path.insert(0, str(Path(__file__).parent))
