# SPDX-License-Identifier: BSD-3-Clause
"""The window shows the picture of a model's screen. PyBullet allows one window per process, so the test runs in a child
process."""
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

from lab_testing import virtual_screen
from lab_testing.waiting import wait_until
from world_picture.shared_picture import PictureWriter

# The screen stands upright and looks along x, where the window's camera is.
LEAN = [[0, 0, 1, 0.3], [1, 0, 0, 0.0], [0, 1, 0, 0.9], [0, 0, 0, 1]]
BODY = {"name": "tv", "joints": [], "urdf": """<robot name="tv"><link name="l"><visual><geometry><box size="0.4 1 0.8"/>
</geometry><origin xyz="0 0 0.9"/></visual></link></robot>"""}
WINDOW = """import json, sys
import numpy as np
from gazebo_ros import window
from world_picture.drawing import DrawingCache
view = window.Window(DrawingCache(), lambda uri: None, print)
values = np.array([0, 0, 0, 0, 0, 0, 1.0])
view.set_scene([json.loads(sys.argv[1])], values)
print("up", flush=True)
for line in sys.stdin:
    view.set_state(values)
"""


@pytest.mark.skipif(not shutil.which("Xvfb"), reason=virtual_screen.MISSING)
def test_pictures_are_seen_the_right_way_round(tmp_path):
    picture = PictureWriter(tmp_path / "picture", 1024, 600)
    body = {**BODY, "screens": [{"link": "l", "offset": np.ravel(LEAN).tolist(), "size": [0.9, 0.53],
                                 "picture": str(picture.path)}]}
    screen = virtual_screen.VirtualScreen()
    window = subprocess.Popen([sys.executable, "-c", WINDOW, json.dumps(body)], env=screen.environment, text=True,
                              stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert any(line == "up\n" for line in window.stdout), "the window has not opened"
        pixels = np.zeros((600, 1024, 3), dtype=np.uint8)
        pixels[:300, :512], pixels[:300, 512:], pixels[300:, :512] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
        picture.show(pixels)

        def is_seen():
            window.stdin.write("\n")
            window.stdin.flush()
            places = []
            found = screen.picture().astype(int)
            for channel in range(3):
                others = [other for other in range(3) if other != channel]
                there = np.nonzero((found[..., channel] > 60) & (found[..., others].max(axis=-1) < 30))
                if len(there[0]) < 2000:
                    return False
                places.append((there[0].mean(), there[1].mean()))
            (red_row, red_column), (green_row, green_column), (blue_row, blue_column) = places
            return (red_column < green_column - 50 and abs(red_column - blue_column) < 50
                    and red_row < blue_row - 50 and abs(red_row - green_row) < 50)

        wait_until(is_seen, "red upper left, green upper right, blue lower left")
    finally:
        window.kill()
        window.wait()
        window.stdin.close()
        window.stdout.close()
        screen.close()
