# SPDX-License-Identifier: BSD-3-Clause
"""A pytest plugin: `--leave-out-long=FILE` runs no test that is marked as long, and writes their names into FILE."""

from pathlib import Path

import pytest


def pytest_addoption(parser):
    parser.addoption("--leave-out-long", metavar="FILE", help="run no long test; FILE gets their names, one a line")


# Last: what -k or a name has left out is not missed.
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    file = config.getoption("--leave-out-long")
    # With -m the caller says which marks run.
    if file is None or config.option.markexpr:
        return
    left_out = [item for item in items if item.get_closest_marker("long")]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in left_out]
    Path(file).write_text("".join(f"{item.nodeid}\n" for item in left_out), encoding="utf-8")
