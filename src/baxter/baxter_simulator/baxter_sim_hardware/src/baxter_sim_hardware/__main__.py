# SPDX-License-Identifier: BSD-3-Clause
"""``python3 -m baxter_sim_hardware``: compile everything into the cache, so that no start has to wait for it."""
import numpy as np

from baxter_sim_hardware.setpoint import SetPoints, any_beyond, approach, follow
from bullet_sim import World
from urdf_model import parse_urdf

LINK = """<link name="%s"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>"""
ROBOT = """<robot name="robot">%s%s<joint name="turn" type="revolute"><parent link="a"/><child link="b"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>""" % (LINK % "a", LINK % "b")


def main():
    here, at_rest, bound = np.zeros(1), np.zeros(1), np.ones(1)
    approach(here, at_rest, here, bound, bound, 1.0)
    points = SetPoints(1)
    follow(points.numbers, points.flags, np.zeros((1, 1)), 0, here, 1.0, 1.0)
    any_beyond(1.0, here, at_rest, here, 1.0)
    world = World()
    model = world.spawn(parse_urdf(ROBOT), "robot", static=True)
    model.call_directly()
    model.drive_position(model.index(["turn"]), here, bound, at_rest)
    world.close()


if __name__ == "__main__":
    main()
