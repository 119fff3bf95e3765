# SPDX-License-Identifier: BSD-3-Clause
"""Hostile planning scenes, and what must hold for each: it is prepared in a bounded time and memory, and where spheres
are free, exact geometry is, too. No ROS needed."""
import random
import resource
import time

import numpy as np

import motion_planning.spheres.cover as covers
from motion_planning.errors import PlanningError
from motion_planning.exact import ExactChecker
from motion_planning.model import PlanningModel
from motion_planning.scene import AttachedBody, Scene, WorldObject
from motion_planning.shapes import Cone, Octree, TriangleMesh
from motion_planning.spheres import Patience, SphereChecker, SphereModel, sphere_model
from urdf_model import Box, Cylinder, Plane, Sphere
from urdf_model.transforms import pose_matrix

#: Greatest processor time for one scene [s], and greatest growth of the process [MB].
MAX_SECONDS, MAX_MEGABYTES = 20.0, 1500.0
SIZES = (0.0, 1e-9, 1e-4, 0.01, 0.1, 0.3, 1.0, 10.0, 1e3, 1e5)
STATES = 12
_LESS = 50
URDF = """<robot name="reacher"><link name="base"/>%s</robot>""" % "".join("""
    <link name="link_%d"><collision><origin xyz="0 0 0.15"/><geometry><box size="0.06 0.06 0.28"/></geometry>
    </collision></link>
    <joint name="joint_%d" type="revolute"><origin xyz="0 0 %g"/><parent link="%s"/><child link="link_%d"/>
    <axis xyz="%s"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>""" % (
        k, k, 0.3 if k else 0.0, "link_%d" % (k - 1) if k else "base", k, "0 1 0" if k % 2 else "1 0 0")
    for k in range(3))
SRDF = """<robot name="reacher"><group name="arm"><chain base_link="base" tip_link="link_2"/></group>
  <disable_collisions link1="link_0" link2="link_1" reason="Adjacent"/>
  <disable_collisions link1="link_1" link2="link_2" reason="Adjacent"/></robot>"""


class Scenes:
    """The scenes of a seed, by number, and their check.

    In the process that makes one, nothing is kept on disk, and objects get coarse after a fiftieth of the usual work,
    so that many scenes are checked in little time; all_work: not so.
    """

    def __init__(self, seed, all_work=False):
        self.seed = seed
        self.model = PlanningModel.from_xml(URDF, SRDF)
        self.exact = ExactChecker(self.model, None)
        self.spheres = SphereModel.of(self.model, None)
        self.group = self.model.groups["arm"]
        sphere_model.cached = lambda function, parts, size: function(parts, size)
        if not all_work:
            sphere_model._MAX_POINTS //= _LESS
            sphere_model._MAX_BOXES //= _LESS
            covers.OF_OBJECTS = covers.WorkBound(*(most // _LESS for most in covers.OF_OBJECTS))
        SphereChecker(self.spheres, self.group, Scene(self.model))

    def problems(self, number):
        """Return what is wrong with the scene ``number``, a list of sentences."""
        choose = random.Random("%d/%d" % (self.seed, number))
        begin, memory = time.process_time(), _megabytes()
        try:
            found = self._unsafe(self._scene(choose), choose)
        except PlanningError:
            found = []  # refused, with a sentence
        except Exception as error:  # what a request must never meet
            found = ["%s: %s" % (type(error).__name__, error)]
        seconds, grown = time.process_time() - begin, _megabytes() - memory
        if seconds > MAX_SECONDS:
            found.append("it took %.1f s of processor time" % seconds)
        if grown > MAX_MEGABYTES:
            found.append("it took %.0f MB" % grown)
        return found

    def _unsafe(self, scene, choose):
        looks = choose.choice((0, 1, 5, 10**9))
        late = iter(range(looks)) if looks < 10**9 else iter(lambda: 0, 1)
        checker = SphereChecker(self.spheres, self.group, scene, patience=Patience(lambda: next(late, None) is None))
        self.exact.prepare(scene, "arm")
        states = np.random.default_rng(choose.randrange(2**31)).uniform(-2.0, 2.0, (STATES, 3))
        free = checker.valid(states)
        first = self.exact.first_blocked(scene, states[free], "arm") if free.any() else None
        if first is None:
            return []
        touching = self.exact.contacts(scene, scene.state.with_q(states[free][first]), "arm")
        # On the edge, both answers are right.
        if max((contact.depth for contact in touching), default=0.0) < 1e-4:
            return []
        return ["spheres are free, but %s" % touching[0]]

    def _scene(self, choose):
        scene = Scene(self.model)
        for number in range(choose.choice((0, 1, 1, 1, 2, 5, 30))):
            scene = scene.with_object(self._object(choose, "object_%d" % number))
        held = {}
        for number in range(choose.choice((0, 0, 0, 1, 2))):
            # What is held has an end: an infinite plane in the hand is left to exact geometry.
            body = self._object(choose, "held_%d" % number, planes=False)
            held[body.id] = AttachedBody(body, choose.choice(("link_2", "link_1", "base")), ("link_1", "link_2"))
        scene = scene.with_state(scene.state.with_attached(held))
        if choose.random() < 0.1:
            scene = scene.with_octomap(_octree(choose), _pose(choose))
        if choose.random() < 0.1:
            scene = scene.with_padding({"link_2": choose.choice(SIZES)},
                                       {"link_1": choose.choice((0.5, 1.0, 2.0, 1e3))})
        return scene

    def _object(self, choose, name, planes=True):
        shapes = tuple((_shape(choose, planes), _pose(choose)) for _ in range(choose.choice((1, 1, 1, 2, 8))))
        return WorldObject(name, _pose(choose), shapes)


def _pose(choose):
    far = choose.choice((0.0, 0.3, 0.6, 1.0, 50.0, 9e4))
    turn = [choose.uniform(-3.0, 3.0) for _ in range(3)] if choose.random() < 0.5 else (0.0, 0.0, 0.0)
    return pose_matrix([choose.uniform(-far, far) for _ in range(3)], turn)


def _size(choose):
    return choose.choice(SIZES) * choose.choice((1.0, 1.0, choose.uniform(0.5, 2.0)))


def _shape(choose, planes):
    kind = choose.randrange(7)
    if kind == 0:
        return Box(tuple(_size(choose) for _ in range(3)))
    if kind == 1:
        return Sphere(_size(choose))
    if kind == 2:
        return Cylinder(_size(choose), _size(choose))
    if kind == 3:
        return Cone(max(1e-9, _size(choose)), max(1e-9, _size(choose)))
    if kind == 4 and planes:
        return Plane()
    return _mesh(choose)


def _mesh(choose):
    """Triangles in any order and of any size: flat, far apart, without area, all the same."""
    rng = np.random.default_rng(choose.randrange(2**31))
    corners = rng.normal(size=(choose.choice((1, 3, 4, 30)), 3)) * [_size(choose) for _ in range(3)]
    if choose.random() < 0.2:
        corners[rng.integers(len(corners))] *= choose.choice((1e3, 1e-3))
    return TriangleMesh(corners, rng.integers(len(corners), size=(choose.choice((1, 2, 12, 60, 60, 500)), 3)))


def _octree(choose):
    rng, side = np.random.default_rng(choose.randrange(2**31)), choose.choice((0.01, 0.1, 1.0))
    cells = rng.integers(-20, 20, (choose.choice((1, 50, 2000)), 3))
    return Octree(side, np.column_stack([(cells + 0.5) * side, np.full(len(cells), side)]))


def _megabytes():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
