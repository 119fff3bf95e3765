# SPDX-License-Identifier: BSD-3-Clause
"""Libraries that only sets of demonstrations need: installed on first use in the workspace, asked for elsewhere."""
from __future__ import annotations

import importlib
import importlib.util
import os
from pathlib import Path
from types import ModuleType

from lab_batch import JobError, on_first_use, parquet

from .frames import DemonstrationError

#: {module: file of what is installed for it}
REQUIREMENTS = {"pyarrow": parquet.REQUIREMENTS, "av": Path(__file__).with_name("requirements-av.txt")}


def need(module: str, submodule: str = "") -> ModuleType:
    """The module, or one of its submodules, imported. Raises DemonstrationError, which says how to install it."""
    if importlib.util.find_spec(module) is None:
        root = os.environ.get("LAB_ROOT")
        if not root:
            raise DemonstrationError("sets of LeRobot's format need %s, which is not installed: pip install "
                                     "'baxter-lab[lerobot]'" % module)
        try:
            on_first_use.ensure_installed(Path(root), module, REQUIREMENTS[module])
        except JobError as error:
            raise DemonstrationError(str(error)) from error
    return importlib.import_module("%s.%s" % (module, submodule) if submodule else module)
