# SPDX-License-Identifier: BSD-3-Clause
"""A plan does not wait for the compiler: it did for eight seconds, in which the arm went on towards what it searched a
way around."""
import subprocess
import sys
from pathlib import Path

# In another process: in this one other tests have called the same functions.
_PROGRAM = """
import sys
import time
from types import SimpleNamespace

import numpy as np
from numba.core.registry import CPUDispatcher

from motion_planning import pipeline
from motion_planning.constraints import ConstraintSet, JointTarget
from motion_planning.exact import ExactChecker
from motion_planning.model import PlanningModel
from motion_planning.replanning import Running, redirected
from motion_planning.scene import Scene, WorldObject
from motion_planning.timing import time_path
from moveit_ros_move_group.planning import Planner
from urdf_model import Box
from urdf_model.transforms import rigid

sys.path.insert(0, sys.argv[1])
from conftest import SRDF, URDF

model = PlanningModel.from_xml(URDF, SRDF)
planner = Planner(SimpleNamespace(model=model, exact=ExactChecker(model, None)), None)
planner._warm_up()


def never(function, *_, **__):
    raise AssertionError("%s is called with other arguments than before" % function.py_func.__qualname__)


CPUDispatcher._compile_for_args = never
group = model.groups["arm"]
ends = np.array([[-0.9, 0.2], [0.9, 0.4]])
thing = WorldObject("thing", rigid(np.eye(3), (0.9, 0.9, 0.5)), ((Box((0.1, 0.1, 0.1)), np.eye(4)),))
scene = Scene(model).with_object(thing)
scene = scene.with_state(scene.state.with_q(ends[0], group.indices))
goal = ConstraintSet(joints=[JointTarget(name, value, 1e-3, 1e-3) for name, value in zip(group.joints, ends[1])])
query = pipeline.PlanQuery(scene, "arm", [goal])
tools = planner._tools(lambda: False)
assert len(pipeline.plan(query, tools).timed.times) > 2
timed = time_path(ends, np.full(2, 0.2), np.full(2, 0.5), "ruckig")
begin = time.monotonic()
# What is in the way is far; which way is found does not matter here.
found = redirected(query, tools, Running(timed, lambda: 1.0 + time.monotonic() - begin, timed.duration + 1.0))
assert found.begin > 1.0
print("planned")
"""


def test_all_that_a_plan_calls_was_called_before():
    done = subprocess.run([sys.executable, "-c", _PROGRAM, str(Path(__file__).parent)], capture_output=True, text=True,
                          timeout=300.0)
    assert (done.returncode, done.stdout) == (0, "planned\n"), done.stderr
