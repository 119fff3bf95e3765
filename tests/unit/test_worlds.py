# SPDX-License-Identifier: BSD-3-Clause
"""The summary that tests/worlds/run.py makes of the warnings of a world."""
import importlib.util
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "worlds"


@pytest.fixture
def run(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    spec = importlib.util.spec_from_file_location("worlds_run", FOLDER / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.modules.pop("checks", None)


def test_what_has_no_effect_is_named_behind_what_was_read_in_another_way(run):
    read = "not as SDF has it, but read: attribute xyz of <gravity> (a.world line 14), <kd> of 9 (a.world line 59)"
    unknown = "; not known and left out: damping (a.world line 31), color (a.world line 43)"
    idle = "; without an effect here: there is no fog: fog (a.world line 3)"
    assert run.summary(read + unknown) == "elements: damping, color"
    assert run.summary(read + idle + unknown) == "elements: fog, damping, color"
    assert run.summary(read) == ""
    assert run.summary(read + "; model 'a': plugins that are not known here: 'libA.so'") == "plugins: libA.so"
