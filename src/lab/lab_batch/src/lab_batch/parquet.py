# SPDX-License-Identifier: BSD-3-Clause
"""Results as Parquet (https://parquet.apache.org), which pandas, R and others read. pyarrow is installed on first use.
"""
from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import on_first_use

if TYPE_CHECKING:
    from lab_batch.job import Outcome

REQUIREMENTS = Path(__file__).with_name("requirements-pyarrow.txt")
_FIXED = ("seed", "seconds", "error")


def columns_of(outcomes: list[Outcome]) -> dict[str, list[Any]]:
    """{name: [a value or None for each Outcome]}: seed, seconds, error (None where it ended well), then the results.

    A result that is named as one of these three gets the name result.NAME.
    """
    columns = {"seed": [one.seed for one in outcomes], "seconds": [one.seconds for one in outcomes],
               "error": [one.error or None for one in outcomes]}
    for name in dict.fromkeys(name for one in outcomes for name in one.result):
        columns["result." + name if name in _FIXED else name] = [one.result.get(name) for one in outcomes]
    return columns


def ensure_installed(root: Path) -> None:
    """Make pyarrow importable; install it below root/.baxter on first use. Raises JobError."""
    on_first_use.ensure_installed(root, "pyarrow", REQUIREMENTS, "batches without --parquet need nothing")


def write(path: Path, header: dict[str, Any], outcomes: list[Outcome]) -> None:
    """Write outcomes in one file; header: what JSON can hold, kept as the file's metadata ``batch``.

    Dictionaries, and values of a result that have different types, become JSON texts. :func:`ensure_installed` has been
    called before. Raises OSError.
    """
    import pyarrow  # pyright: ignore[reportMissingImports]
    from pyarrow import parquet  # pyright: ignore[reportMissingImports]

    arrays = {}
    for name, values in columns_of(outcomes).items():
        try:
            arrays[name] = pyarrow.array(values, pyarrow.string() if name == "error" else None)
        except (pyarrow.ArrowException, OverflowError):
            arrays[name] = None
        # Parquet has no dictionary without entries.
        if arrays[name] is None or "struct<" in str(arrays[name].type):
            arrays[name] = pyarrow.array([None if value is None else json.dumps(value) for value in values])
    table = pyarrow.table(arrays).replace_schema_metadata({"batch": json.dumps(header)})
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table, path)
