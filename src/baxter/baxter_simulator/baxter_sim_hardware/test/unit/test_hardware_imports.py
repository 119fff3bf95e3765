# SPDX-License-Identifier: BSD-3-Clause
"""The modules that processes load, and when."""
import json
import subprocess
import sys

import numba
import pytest
from baxter_core_msgs.msg import JointCommand
from numba.core.dispatcher import Dispatcher

from baxter_model import joint_names
from baxter_sim_hardware import compiled, effects
from baxter_sim_hardware.arms.joint_command import Mode

HEARD = ("*",)
LOADED = """
import json, sys
from numba.core.dispatcher import Dispatcher
from baxter_sim_hardware import compiled, effects
compiled.load()
if "robot" in sys.argv:
    compiled.load_of_effects(effects.read(effects.physical_robot()))
print(json.dumps({found.py_func.__qualname__: list(map(str, found.signatures))
    for name, module in list(sys.modules.items()) if name.startswith("baxter_sim_hardware")
    for found in vars(module).values() if isinstance(found, Dispatcher)}))
"""


def printed_by(program, *words):
    return subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, timeout=300,
                          check=True).stdout


@pytest.mark.parametrize("module", ["individual", "topics.camera_driver", "sensing.optics"])
def test_cameras_and_spawning_load_no_compiled_code(module):
    assert printed_by("import sys, baxter_sim_hardware.%s; print([name for name in ('numba', 'pybullet') "
                      "if name in sys.modules])" % module) == "[]\n"


@pytest.mark.parametrize(("profile", "chosen"), [("sim", {}), ("robot", {}), ("robot", {"effects": "noise"})],
                         ids=["sim", "robot", "noise"])
def test_the_first_tick_finds_its_functions_loaded(make_lab, monkeypatch, profile, chosen):
    # They call each other, and none can be compiled while it is replaced.
    compiled.load()
    compiled.load_of_effects(effects.read(effects.physical_robot()))
    called = {}

    def recorded(function):
        def call(*arguments):
            types = str(tuple(map(numba.typeof, arguments)))
            called.setdefault(function.py_func.__qualname__, set()).add(types)
            return function(*arguments)
        return call

    for module in [module for name, module in sys.modules.items() if name.startswith("baxter_sim_hardware")]:
        for name, found in list(vars(module).items()):
            if isinstance(found, Dispatcher):
                monkeypatch.setattr(module, name, recorded(found))
    lab = make_lab(parameters={"profile": profile, **chosen})
    lab.enable()
    lab.run(0.1)
    for mode in Mode:
        names = list(joint_names("left"))
        lab.send("limb/left/joint_command", JointCommand(mode, [0.1] * len(names), names))
        lab.run(0.1)
    loaded = json.loads(printed_by(LOADED, profile))
    assert {"follow", "approach", "any_beyond", "_clamp", "shares_in_step", "cruising_speeds"} <= called.keys()
    assert {name: types - set(loaded[name]) for name, types in called.items()} == dict.fromkeys(called, set())
