# SPDX-License-Identifier: BSD-3-Clause
"""A small world for tests: a floor, a static table, a free block on it, an arm with one joint."""
import contextlib

import numpy as np

from world_picture.snapshot import SnapshotWriter


def box(name, size, colour, place="0 0 0"):
    return ('<link name="%s"><visual><origin xyz="%s"/><geometry><box size="%s"/></geometry><material name="c"><color '
            'rgba="%s 1"/></material></visual></link>' % (name, place, size, colour))


TABLE = '<robot name="table">%s</robot>' % box("top", "1 1 0.1", "0.6 0.4 0.2")
BLOCK = '<robot name="block">%s</robot>' % box("body", "0.1 0.1 0.1", "0.9 0.1 0.1")
ARM = """<robot name="arm">%s%s<joint name="j" type="revolute"><parent link="foot"/><child link="rod"/>
<axis xyz="0 0 1"/><origin xyz="0 0 0.2"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>""" % (
    box("foot", "0.1 0.1 0.4", "0.2 0.2 0.8"), box("rod", "0.6 0.05 0.05", "0.1 0.8 0.1", "0.3 0 0"))
FLOOR = {"name": "floor", "joints": [], "urdf": None, "static": True}
SCENE = [FLOOR, {"name": "table", "joints": [], "urdf": TABLE, "static": True},
         {"name": "block", "joints": [], "urdf": BLOCK, "static": False},
         {"name": "arm", "joints": ["j"], "urdf": ARM, "static": True}]
#: Places of the three models.
TABLE_AT, BLOCK_AT, ARM_AT = (0.0, 0.0, 0.45), (0.2, 0.1, 0.55), (-0.8, 0.6, 0.2)


def at(place, *joints):
    return [*place, 0.0, 0.0, 0.0, 1.0, *joints]


def values(block=BLOCK_AT, joint=0.0):
    """The state of SCENE."""
    return np.array([*at((0, 0, 0)), *at(TABLE_AT), *at(block), *at(ARM_AT, joint)], dtype=float)


@contextlib.contextmanager
def snapshot(folder, scene=SCENE):
    """A simulator's snapshot with ``scene`` in it, which has SCENE's bodies."""
    writer = SnapshotWriter(folder)
    try:
        writer.write_scene(scene)
        writer.write(0, 0.0, [values()])
        yield writer
    finally:
        writer.close()
