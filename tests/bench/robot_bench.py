# SPDX-License-Identifier: BSD-3-Clause
"""Cost of Baxter's control logic: CPU time of update() and publish() a tick, on the real physics, without a master."""
import importlib.util
import time
from pathlib import Path

import numpy as np
import rospkg

import xacro
from urdf_model import parse_urdf

SECONDS = 4.0
TICKS = int(SECONDS / 0.002)
CASES = (  # (title, command mode or None, whether every topic has a subscriber)
    ("idle, nobody listens", None, False),
    ("idle, all topics", None, True),
    ("position, commands at 100 Hz, all topics", 1, True),
    ("velocity, commands at 100 Hz, all topics", 2, True),
    ("torque, commands at 100 Hz, all topics", 3, True),
    ("raw position, commands at 100 Hz, all topics", 4, True),
)


def load_lab():
    """The Lab of the package's unit tests: plugin, world and topics as lists."""
    path = Path(rospkg.RosPack().get_path("baxter_sim_hardware")) / "test/unit/conftest.py"
    spec = importlib.util.spec_from_file_location("lab", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Lab


def tick_costs(lab, before, listeners, ticks):
    """Mean (update, publish, physics step) in microseconds over ``ticks``; `before(tick)` is not counted."""
    for publisher in lab.publishers.values():
        publisher.has_listeners = listeners
        publisher.publish = lambda message: None
    update = publish = step = 0.0
    for tick in range(ticks):
        before(tick)
        begin = time.thread_time()
        lab.plugin.update(lab.world.time_s, 0.002)
        middle = time.thread_time()
        lab.world.step()
        stepped = time.thread_time()
        lab.plugin.publish(lab.world.time_s)
        update += middle - begin
        step += stepped - middle
        publish += time.thread_time() - stepped
    return tuple(1e6 * total / ticks for total in (update, publish, step))


def measure(report, quick, number):
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    robot = parse_urdf(xacro.process_file(file).toxml(), source=file)
    lab_class = load_lab()
    for title, mode, listeners in CASES:
        lab = lab_class(robot, parameters={"enable": True})
        start = lab.position
        wave = 0.1 * np.ones(14)

        def command(tick, lab=lab, mode=mode, start=start, wave=wave):
            if mode and tick % 5 == 0:
                swing = wave * np.sin(0.01 * tick)
                lab.command(mode, start + swing if mode in (1, 4) else swing)

        # The first tick loads the compiled set-points, once per process.
        tick_costs(lab, command, listeners, 10)
        update, publish, step = tick_costs(lab, command, listeners, TICKS // 10 if quick else TICKS)
        report.add("%s: update and publish" % title, update + publish, "us", ("physics step", step))
        lab.close()
