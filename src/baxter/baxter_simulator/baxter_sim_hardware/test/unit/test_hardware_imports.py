# SPDX-License-Identifier: BSD-3-Clause
"""What processes load, and when."""
import json
import subprocess
import sys

import pytest
from numba.core.dispatcher import Dispatcher

HEARD = ("*",)
LOADED = """
import json, sys
from numba.core.dispatcher import Dispatcher
from baxter_sim_hardware import compiled
compiled.load()
print(json.dumps(sorted({found.py_func.__qualname__ for name, module in list(sys.modules.items())
    if name.startswith("baxter_sim_hardware") for found in vars(module).values()
    if isinstance(found, Dispatcher) and found.signatures})))
"""


def printed_by(program):
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300,
                          check=True).stdout


@pytest.mark.parametrize("module", ["individual", "topics.camera_driver", "sensing.optics"])
def test_cameras_and_spawning_load_no_compiled_code(module):
    assert printed_by("import sys, baxter_sim_hardware.%s; print([name for name in ('numba', 'pybullet') "
                      "if name in sys.modules])" % module) == "[]\n"


def test_the_first_tick_finds_its_functions_loaded(make_lab, monkeypatch):
    called = set()

    def recorded(function):
        def call(*arguments):
            called.add(function.py_func.__qualname__)
            return function(*arguments)
        return call

    for module in [module for name, module in sys.modules.items() if name.startswith("baxter_sim_hardware")]:
        for name, found in list(vars(module).items()):
            if isinstance(found, Dispatcher):
                monkeypatch.setattr(module, name, recorded(found))
    lab = make_lab()
    lab.enable()
    lab.run(0.1)
    assert {"follow", "approach", "any_beyond"} <= called
    assert called <= set(json.loads(printed_by(LOADED)))
