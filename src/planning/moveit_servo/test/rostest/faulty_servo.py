#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""servo_server, in whose thread that follows the scene an error comes up once, with the first object."""
from moveit_servo import node


class Faulty(node.Surroundings):
    faults = 1

    def __init__(self, sphere_model, group, scene):
        if scene.objects and Faulty.faults:
            Faulty.faults -= 1
            raise RuntimeError("an error that nobody foresaw")
        super().__init__(sphere_model, group, scene)


if __name__ == "__main__":
    node.Surroundings = Faulty
    node.main()
