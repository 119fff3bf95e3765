# SPDX-License-Identifier: BSD-3-Clause
"""The unit tests' locale, which writes 0,5 for 0.5.

Python itself starts with LC_NUMERIC=C; a window toolkit, or a C library that calls
setlocale(), changes that for the whole process, and from then on strtod() in C code stops at the point in "0.5".
"""

import subprocess
import tempfile
from pathlib import Path

NAME = "de_DE.UTF-8"


def variables(folder: Path) -> dict[str, str]:
    """The environment variables for it; the locale is compiled into folder if the folder does not have it yet.

    Raises OSError or subprocess.CalledProcessError if localedef or its sources are missing.
    """
    target = folder / NAME
    if not target.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        # Workers start at the same time: each makes its own, and the first one's is taken.
        with tempfile.TemporaryDirectory(dir=folder) as drafts:
            draft = Path(drafts, NAME)
            # localedef only warns about unknown tokens, and then exits with 1 although it wrote the locale.
            command = ["localedef", "--no-archive", "-c", "-i", "de_DE", "-f", "UTF-8", str(draft)]
            done = subprocess.run(command, capture_output=True, text=True)
            if not (draft / "LC_NUMERIC").is_file():
                raise subprocess.CalledProcessError(done.returncode, command, done.stdout, done.stderr)
            try:
                draft.rename(target)
            except OSError:
                if not target.is_dir():
                    raise
    return {"LOCPATH": str(folder), "LC_ALL": NAME}
