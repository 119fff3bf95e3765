# SPDX-License-Identifier: BSD-3-Clause
"""A pytest plugin that leaves tests out by their marks, unless the caller says with -m which marks run.

`--leave-out-long=FILE` runs no test that is marked as long, and writes their names into FILE. Where another pytest runs
at the same time, `--in-the-other-run=MARK` says that it has the tests with MARK, and `--in-this-run=MARK,MARK` that it
has all others; a test that is marked as long is never in the other run.
"""

from pathlib import Path

import pytest


def pytest_addoption(parser):
    parser.addoption("--leave-out-long", metavar="FILE", help="run no long test; FILE gets their names, one per line")
    parser.addoption("--in-the-other-run", metavar="MARK", help="run no test with this mark, unless it is long")
    parser.addoption("--in-this-run", metavar="MARKS", help="run only tests with one of these marks, and long ones")


# Run last: tests that -k or a name has deselected do not count.
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    if config.option.markexpr:
        return
    file, elsewhere = config.getoption("--leave-out-long"), config.getoption("--in-the-other-run")
    here = config.getoption("--in-this-run")
    if elsewhere is not None:
        _leave_out(config, items, lambda item: item.get_closest_marker(elsewhere) and not _is_long(item))
    if here is not None:
        marks = ["long", *here.split(",")]
        _leave_out(config, items, lambda item: not any(map(item.get_closest_marker, marks)))
    if file is not None:
        left_out = _leave_out(config, items, _is_long)
        Path(file).write_text("".join(f"{item.nodeid}\n" for item in left_out), encoding="utf-8")


def _is_long(item):
    return item.get_closest_marker("long") is not None


def _leave_out(config, items, is_out):
    left_out = [item for item in items if is_out(item)]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if not is_out(item)]
    return left_out
