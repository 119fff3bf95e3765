# SPDX-License-Identifier: BSD-3-Clause
"""The controller that docs/write_a_controller.md shows, and the test it shows with it, work as printed."""
import re
import sys
import textwrap
import types
from pathlib import Path

import yaml

PAGE = next(folder for folder in Path(__file__).resolve().parents if (folder / "docs").is_dir()) / "docs"
TEXT = (PAGE / "write_a_controller.md").read_text()


def block(first_words):
    """The indented block that contains ``first_words``."""
    blocks = re.findall(r"(?:^    .*\n|^\n(?=\n*    ))+", TEXT, flags=re.MULTILINE)
    return textwrap.dedent(next(found for found in blocks if first_words in found))


def test_the_page_runs(monkeypatch):
    package, module = types.ModuleType("my_lab"), types.ModuleType("my_lab.swing")
    monkeypatch.setitem(sys.modules, "my_lab", package)
    monkeypatch.setitem(sys.modules, "my_lab.swing", module)
    exec(compile(block("class SwingController"), "swing.py", "exec"), module.__dict__)
    test = {}
    exec(compile(block("def test_it_swings"), "test_swing.py", "exec"), test)
    test["test_it_swings"]()


def test_the_line_of_the_table_names_the_class():
    entry = yaml.safe_load(re.search(r">(my_lab/.*?)</rosparam>", TEXT).group(1))
    assert entry == {"my_lab/SwingController": "my_lab.swing:SwingController"}
