# SPDX-License-Identifier: BSD-3-Clause
"""The world's window without the screen: its thread that draws, for a Baxter that moves both arms and at rest."""
import math
import time

import numpy as np
import rospkg

import xacro
from lab_testing.waiting import wait_until
from sensor_renderer.best import best_renderer
from urdf_model import merge_fixed, parse_urdf
from world_picture.snapshot import SnapshotWriter
from world_window.stage import WindowStage
from world_window.viewer import Viewer

SECONDS = 10.0
SIZE = (1000, 700)
MIN_RATE = 20.0
_WAIT_S = 120.0


def measure(report, quick, number):
    seconds = 2.0 if quick else SECONDS
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    xml = xacro.process_file(file).toxml()
    joints = list(merge_fixed(parse_urdf(xml, source=file)).joints.values())
    writer, drawn = SnapshotWriter(), []
    viewer = Viewer(lambda: str(writer.folder), lambda: best_renderer()[0],
                    lambda frame: frame.pixels is not None and drawn.append(1), lambda pull: None, print)
    viewer.post(WindowStage.resize, *SIZE)
    try:
        writer.write_scene([{"name": "floor", "urdf": None, "joints": []},
                            {"name": "robot", "urdf": xml, "joints": [joint.name for joint in joints]}])
        viewer.start()
        run(writer, joints, 0.0, lambda: bool(drawn))
        for what, stretch_rad in (("both arms moving", 0.5), ("at rest", 0.0)):
            before, wall, used = len(drawn), time.monotonic(), time.process_time()
            run(writer, joints, stretch_rad, lambda wall=wall: time.monotonic() - wall > seconds)
            count, elapsed, used = len(drawn) - before, time.monotonic() - wall, time.process_time() - used
            if stretch_rad:
                report.add("%d x %d, %s: pictures" % (*SIZE, what), count / elapsed, "Hz", least=MIN_RATE)
                report.add("%d x %d, %s: CPU of a picture" % (*SIZE, what), 1e3 * used / max(count, 1), "ms")
            report.add("%d x %d, %s: CPU" % (*SIZE, what), 100.0 * used / elapsed, "% of a core")
    finally:
        viewer.end()
        writer.close()


def run(writer, joints, stretch_rad, is_over):
    """Write states 100 times a second, as the simulator does, with revolute joints that swing by ``stretch_rad``, until
    ``is_over()``."""
    begin, tick = time.monotonic(), 0

    def goes_on():
        nonlocal tick
        tick += 1
        angle = stretch_rad * math.sin(2.0 * (time.monotonic() - begin))
        values = [angle if joint.type == "revolute" else 0.0 for joint in joints]
        writer.write(tick, 0.01 * tick, [np.array([0.0] * 6 + [1.0]), np.array([0.0] * 2 + [0.93] + [0.0] * 3 + [1.0]),
                                         np.array(values)])
        return is_over()

    wait_until(goes_on, "the pictures", _WAIT_S, 0.01)
