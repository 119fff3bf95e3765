# SPDX-License-Identifier: BSD-3-Clause
"""The servo minds the convex parts of links, which in a simulator reach beyond their meshes."""
import sys
from pathlib import Path

import numpy as np
import pytest

from motion_planning.model import PlanningModel
from motion_planning.scene import Scene
from motion_planning.shapes import TriangleMesh
from motion_planning.spheres import SphereModel
from moveit_servo.convex_parts import ConvexParts, cuts_named
from moveit_servo.settings import SettingsError
from moveit_servo.surroundings import Surroundings

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import PLANAR_SRDF, PLANAR_URDF  # noqa: E402

WALL = PLANAR_URDF.replace("</robot>", (
    '<link name="wall"><collision><geometry><mesh filename="corner.stl"/></geometry></collision></link>'
    '<joint name="at" type="fixed"><origin xyz="0.4 0 0"/><parent link="base"/><child link="wall"/></joint></robot>'))
# Whole, its convex hull fills the corner; cut at x = 0, each half is flat.
CUTS, HALVES, MOVING = {"wall": ()}, {"wall": (("x", 0.0),)}, {"link1": ()}
NUMBER, AXIS, ENDLESS, SHORT = ({"wall": planes} for planes in (5, (("w", 0.1),), (("x", np.inf),), (("x",),)))


def corner(_):
    """Two vertical walls that meet in an edge at x = 0, y = 0.6 m, in front of the arm and wide open to it."""
    x, y = np.array([-0.6, 0.0, 0.6]), np.array([0.2, 0.6, 0.2])
    vertices = [(x[k], y[k], z) for k in range(3) for z in (-0.3, 0.3)]
    return TriangleMesh(np.array(vertices), np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5]]))


def nearest(cuts, q, allowed=()):
    """The least gap [m] of the planar arm at ``q`` (3,); infinite where nothing is within 12 cm."""
    model = PlanningModel.from_xml(WALL, PLANAR_SRDF)
    spheres, scene = SphereModel.of(model, corner), Scene(model)
    scene = scene.with_allowed(scene.allowed.with_entries(dict.fromkeys(allowed, True)))
    surroundings = Surroundings(spheres, model.groups["arm"], ConvexParts(spheres, cuts).added_to(scene))
    return surroundings.near(np.array(q), np.zeros(3), 0.12).distance.min(initial=np.inf)


INTO_THE_CORNER = (-1.0, 2.0, 0.57)


def test_an_arm_is_inside_of_a_convex_part_and_beside_the_mesh():
    assert nearest({}, INTO_THE_CORNER) > 0.0
    assert nearest(CUTS, INTO_THE_CORNER) < -0.03
    assert nearest(HALVES, INTO_THE_CORNER) == pytest.approx(nearest({}, INTO_THE_CORNER), abs=0.02)


def test_parts_may_touch_what_their_link_may_touch():
    free = [("wall", "link%d" % number) for number in range(3)]
    assert nearest(CUTS, INTO_THE_CORNER, free) == np.inf


def test_links_that_the_robot_lacks_have_no_parts():
    assert nearest({"pedestal": ()}, INTO_THE_CORNER) == nearest({}, INTO_THE_CORNER)


@pytest.mark.parametrize(("name", "fact"), [
    ("no.such.PLACE", "no"), ("moveit_servo.settings.NOTHING", "NOTHING"), ("planes", "planes"),
    ("moveit_servo.settings.BAXTER", "str"), (__name__ + ".MOVING", "link1"),
    *((__name__ + "." + planes, "wall") for planes in ("NUMBER", "AXIS", "ENDLESS", "SHORT"))])
def test_what_names_no_cuts_is_refused(name, fact):
    with pytest.raises(SettingsError, match=fact):
        cuts_named(name, PlanningModel.from_xml(WALL, PLANAR_SRDF))


def test_cuts_of_a_module_and_none():
    model = PlanningModel.from_xml(WALL, PLANAR_SRDF)
    assert cuts_named(__name__ + ".CUTS", model) is CUTS and cuts_named("", model) == {}
