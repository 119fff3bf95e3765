# SPDX-License-Identifier: BSD-3-Clause
"""A change of any file whose functions are compiled together leads to another folder of the cache."""
from pathlib import Path

import pytest

from disk_cache import compiled as disk_cache_compiled
from motion_planning import lanes

PACKAGE = Path(lanes.__file__).parent
#: What uses spheres.compiled; other folders have compilers of their own.
FILES = sorted(path for folder in ("spheres", "planners") for path in (PACKAGE / folder).glob("*.py")
               if "\n@compiled\n" in path.read_text(encoding="utf-8"))


@pytest.fixture
def sources(monkeypatch):
    found = []
    monkeypatch.setattr(disk_cache_compiled, "compiler", lambda name, sources, **_: found.extend(sources))
    path = PACKAGE / "spheres/compiled.py"
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), {"__file__": str(path)})
    return found


def test_each_file_with_compiled_functions_is_a_source(sources):
    assert len(FILES) > 3 and {*FILES, PACKAGE / "lanes.py"} <= set(sources)
