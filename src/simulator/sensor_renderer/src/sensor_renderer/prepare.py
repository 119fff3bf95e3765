# SPDX-License-Identifier: BSD-3-Clause
"""Make the drawings of robots before their first start, which otherwise waits for them. ROS-free.

    python3 -m sensor_renderer.prepare ROBOT.urdf.xacro...
"""
from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path

from model_files.resources import ResourceFinder
from sensor_renderer.errors import RenderingError
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from urdf_model import description_text
from world_picture.drawing import DrawingCache


def main(arguments: Sequence[str] | None = None) -> int:
    """Prepare the robots of files, and return the exit status: 1 if one of them cannot be read."""
    parser = argparse.ArgumentParser(
        prog="sensor_renderer.prepare", description="Make the drawings of robots, so that their first pictures do not "
        "wait for them.")
    parser.add_argument("urdf", type=Path, nargs="+", help="a robot: URDF or xacro file")
    failed = False
    for path in parser.parse_args(arguments).urdf:
        try:
            prepare(description_text(path))
        except (ValueError, OSError) as error:
            failed = True
            print("sensor_renderer.prepare: %s: %s" % (path, error), file=sys.stderr)
    return int(failed)


def prepare(urdf: str) -> None:
    """Make all that pictures of the robot ``urdf``, a text, need of its shapes.

    Raises ``ValueError`` for a text that is no robot; a mesh that cannot be read is one line on stderr.
    """
    mirror = Mirror(DrawingCache(), ResourceFinder(), lambda text: print(text, file=sys.stderr))
    mirror.set_scene([{"name": "robot", "urdf": urdf, "joints": []}])
    # Without EGL, the reduced meshes alone are used.
    with contextlib.suppress(RenderingError):
        renderer = GlRenderer()
        try:
            renderer.prepare(mirror)
        finally:
            renderer.close()


if __name__ == "__main__":
    sys.exit(main())
