#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What Baxter's brain costs: CPU microseconds a tick of update() and publish(), on the real physics, without a master.

    python tests/bench/robot_bench.py
"""
import importlib.util
import time
from pathlib import Path

import numpy as np
import rospkg

import xacro
from urdf_model import parse_urdf

SECONDS = 4.0
TICKS = int(SECONDS / 0.002)
CASES = (  # (title, command mode or None, whether somebody listens to every topic)
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


def measure(lab, before, listeners):
    """Mean (update, publish) in microseconds over TICKS ticks; `before(tick)` is not counted."""
    for outbox in lab.outboxes.values():
        outbox.has_listeners = listeners
        outbox.publish = lambda message: None
    update = publish = 0.0
    for tick in range(TICKS):
        before(tick)
        begin = time.thread_time()
        lab.plugin.update(lab.world.time_s, 0.002)
        middle = time.thread_time()
        lab.world.step()
        stepped = time.thread_time()
        lab.plugin.publish(lab.world.time_s)
        update += middle - begin
        publish += time.thread_time() - stepped
    return 1e6 * update / TICKS, 1e6 * publish / TICKS


def main():
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    robot = parse_urdf(xacro.process_file(file).toxml(), source=file)
    lab_class = load_lab()
    print("%-46s %8s %8s" % ("both arms, 500 Hz, us a tick", "update", "publish"))
    for title, mode, listeners in CASES:
        lab = lab_class(robot, parameters={"enable": True})
        start = lab.position
        wave = 0.1 * np.ones(14)

        def command(tick, lab=lab, mode=mode, start=start, wave=wave):
            if mode and tick % 5 == 0:
                swing = wave * np.sin(0.01 * tick)
                lab.command(mode, start + swing if mode in (1, 4) else swing)

        print("%-46s %8.1f %8.1f" % (title, *measure(lab, command, listeners)))
        lab.close()


if __name__ == "__main__":
    main()
