# SPDX-License-Identifier: BSD-3-Clause
"""PyBullet's window as a mirror of the world: it draws the snapshot and computes no physics. ROS-free."""
import subprocess
import sys

import numpy as np

from bullet_sim.quiet_pybullet import pybullet
from gazebo_ros.window_screen import WindowScreen
from urdf_model import Box, Cylinder, Mesh, Sphere, merge_fixed, parse_urdf
from urdf_model.transforms import quaternion_from_matrix
from world_picture.drawing import DrawingError
from world_picture.snapshot import SnapshotError

# The camera's first pose: in front of a robot that looks along x, a little to its left.
_CAMERA = {"cameraDistance": 1.9, "cameraYaw": 55.0, "cameraPitch": -15.0, "cameraTargetPosition": [0.25, 0.0, 0.85]}
_DEFAULT_COLOUR = (0.7, 0.7, 0.7, 1.0)
_LAMP_DISTANCE_M = 10.0
_FLOOR_HALF_M, _TILE_M = 4.0, 0.5
_FLOOR_COLOURS = ((0.78, 0.80, 0.82, 1.0), (0.70, 0.72, 0.75, 1.0))
_PROBE = "import pybullet, sys; sys.exit(pybullet.connect(pybullet.GUI, options='--width=64 --height=48') < 0)"
_PROBE_TIMEOUT_S = 30.0
_SHAPE_TYPES = {Box: pybullet.GEOM_BOX, Cylinder: pybullet.GEOM_CYLINDER, Sphere: pybullet.GEOM_SPHERE,
                Mesh: pybullet.GEOM_MESH}


def can_open():
    """Whether a window with OpenGL can be opened. A child process tries it, since PyBullet ends its process if it
    cannot."""
    try:
        probe = subprocess.run([sys.executable, "-c", _PROBE], timeout=_PROBE_TIMEOUT_S, check=False,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except subprocess.TimeoutExpired:
        return False
    return probe.returncode == 0


class Window:
    """The window and the bodies in it."""

    def __init__(self, drawings, find_mesh, warn, title="Gazebo", size=(1024, 768), frame_rate=20.0):
        """Opens the window. ``drawings``: :class:`DrawingCache`; ``find_mesh(uri)`` -> path or None; ``warn(text)``."""
        self._drawings = drawings
        self._find_mesh = find_mesh
        self._warn = warn
        self._client = pybullet.connect(pybullet.GUI, options=(
            "--width=%d --height=%d --minGraphicsUpdateTimeMs=%d --window_title=%s "
            "--background_color_red=0.62 --background_color_green=0.70 --background_color_blue=0.80"
            % (*size, round(1000.0 / frame_rate), title)))
        for flag in (pybullet.COV_ENABLE_GUI, pybullet.COV_ENABLE_SHADOWS, pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS):
            pybullet.configureDebugVisualizer(flag, 0, physicsClientId=self._client)
        pybullet.resetDebugVisualizerCamera(**_CAMERA, physicsClientId=self._client)
        self._bodies = {}
        self._screens = {}
        self._order = []
        self._shown = {}

    @property
    def is_open(self):
        """False once the user has closed the window."""
        return pybullet.isConnected(self._client)

    def set_scene(self, bodies, values):
        """Draw these ``bodies``, as :meth:`SnapshotWriter.write_scene` lists them; bodies that exist already stay.

        ``values`` gives their poses, so that no body ever appears at another place.
        """
        wanted = {body["name"]: body for body in bodies}
        pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_RENDERING, 0, physicsClientId=self._client)
        for name in [name for name, (body, _) in self._bodies.items() if wanted.get(name) != body]:
            for number in self._bodies.pop(name)[1]:
                pybullet.removeBody(number, physicsClientId=self._client)
                self._screens.pop(number, None)
        for name, body in wanted.items():
            if name not in self._bodies:
                self._bodies[name] = (body, self._floor() if body["urdf"] is None else [self._robot(body)])
        self._order = [(body, self._bodies[body["name"]][1]) for body in bodies]
        self._shown = {}
        self.set_state(values)
        pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_RENDERING, 1, physicsClientId=self._client)

    def set_lights(self, lights):
        """Light the window from the direction of the first directional light of ``lights``, listed as by
        :meth:`WorldLights.listed`."""
        for light in lights or ():
            if light["type"] == "directional":
                position = (-_LAMP_DISTANCE_M * np.asarray(light["direction"])).tolist()
                pybullet.configureDebugVisualizer(lightPosition=position, physicsClientId=self._client)
                return

    def set_state(self, values):
        """Move all bodies to the poses in the snapshot's ``values``."""
        start = 0
        for body, numbers in self._order:
            joints = start + 7
            end = joints + len(body["joints"])
            pose, position = values[start:joints].tolist(), values[joints:end].tolist()
            for number in numbers:
                # Each command busy-waits for the window's thread: bodies that did not move get none.
                if self._shown.get((number, "pose")) != pose:
                    self._shown[number, "pose"] = pose
                    pybullet.resetBasePositionAndOrientation(number, pose[:3], pose[3:], physicsClientId=self._client)
                if self._shown.get((number, "joints"), []) != position:
                    self._shown[number, "joints"] = position
                    pybullet.resetJointStatesMultiDof(number, list(range(len(position))),
                                                      [[value] for value in position], physicsClientId=self._client)
            start = end
        for screens in self._screens.values():
            for screen in screens:
                screen.refresh()

    def _robot(self, body):
        merged = merge_fixed(parse_urdf(body["urdf"], source=body["name"]))
        joints = list(merged.joints.values())
        order = {merged.root: 0, **{joint.child: number for number, joint in enumerate(joints, 1)}}
        links = [merged.links[merged.root], *(merged.links[joint.child] for joint in joints)]
        by_colour = [self._by_colour(link) for link in links]
        # PyBullet gives all primitives of a link one colour. A link's first colour is drawn on itself, each further one
        # on a link of its own that is fixed to it; these come last, so that joints keep their numbers.
        more = [(link, parts) for link, groups in enumerate(by_colour) for parts in groups[1:]]
        screens = self._screens_of(body)
        extra = len(more) + len(screens)
        count = len(joints) + extra
        parts = [groups[0] if groups else [] for groups in by_colour] + [parts for _, parts in more]
        shapes = [self._shapes(of_link) for of_link in parts] + [screen.shape for screen in screens]
        zeros, upright = [[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0, 1.0]]
        number = pybullet.createMultiBody(
            baseMass=0.0, baseVisualShapeIndex=shapes[0], baseCollisionShapeIndex=-1,
            linkMasses=[0.0] * count, linkCollisionShapeIndices=[-1] * count, linkVisualShapeIndices=shapes[1:],
            linkPositions=[joint.origin[:3, 3].tolist() for joint in joints] + zeros * extra,
            linkOrientations=[quaternion_from_matrix(joint.origin).tolist() for joint in joints] + upright * extra,
            linkInertialFramePositions=zeros * count, linkInertialFrameOrientations=upright * count,
            linkParentIndices=[order[joint.parent] for joint in joints] + [link for link, _ in more]
            + [order[screen.link] for screen in screens],
            linkJointTypes=[pybullet.JOINT_PRISMATIC if joint.type == "prismatic" else pybullet.JOINT_REVOLUTE
                            for joint in joints] + [pybullet.JOINT_FIXED] * extra,
            linkJointAxis=[joint.axis.tolist() for joint in joints] + [[0.0, 0.0, 1.0]] * extra,
            flags=pybullet.URDF_MAINTAIN_LINK_ORDER, physicsClientId=self._client)
        for link, of_link in enumerate(parts, -1):
            # If a link has several mesh files, each needs its own call.
            for index, (_, _, colour, _) in enumerate(of_link):
                pybullet.changeVisualShape(number, link, shapeIndex=index, rgbaColor=list(colour),
                                           physicsClientId=self._client)
        for link, screen in enumerate(screens, len(joints) + len(more)):
            screen.put_on(number, link)
        self._screens[number] = screens
        return number

    def _screens_of(self, body):
        found = []
        for listed in body.get("screens", ()):
            try:
                found.append(WindowScreen(listed, self._client))
            except SnapshotError as error:
                self._warn(str(error))
        return found

    def _by_colour(self, link):
        """The visual shapes of a link, grouped by colour: a list of lists."""
        groups = {}
        for shape in link.visuals or link.collisions:
            for part in self._parts(shape):
                groups.setdefault(part[2], []).append(part)
        return list(groups.values())

    def _shapes(self, parts):
        if not parts:
            return -1
        columns = {"shapeTypes": [], "halfExtents": [], "radii": [], "lengths": [], "fileNames": [], "meshScales": [],
                   "visualFramePositions": [], "visualFrameOrientations": []}
        for geometry, file, _, origin in parts:
            columns["shapeTypes"].append(_SHAPE_TYPES[type(geometry)])
            columns["halfExtents"].append([side / 2.0 for side in getattr(geometry, "size", (0.0, 0.0, 0.0))])
            columns["radii"].append(getattr(geometry, "radius", 0.0))
            columns["lengths"].append(getattr(geometry, "length", 0.0))
            columns["fileNames"].append(file)
            columns["meshScales"].append(list(getattr(geometry, "scale", (1.0, 1.0, 1.0))))
            columns["visualFramePositions"].append(origin[:3, 3].tolist())
            columns["visualFrameOrientations"].append(quaternion_from_matrix(origin).tolist())
        return pybullet.createVisualShapeArray(**columns, physicsClientId=self._client)

    def _parts(self, shape):
        colour = shape.colour or _DEFAULT_COLOUR
        if not isinstance(shape.geometry, Mesh):
            return [(shape.geometry, "", colour, shape.origin)]
        path = self._find_mesh(shape.geometry.filename)
        if path is None:
            return []  # /gazebo has logged it
        try:
            return [(shape.geometry, part.path, part.colour or colour, shape.origin)
                    for part in self._drawings.parts(path)]
        except DrawingError as error:
            self._warn(str(error))
            return []

    def _floor(self):
        """A chequered floor, half of the tiles per body."""
        bodies = []
        steps = np.arange(-_FLOOR_HALF_M, _FLOOR_HALF_M, _TILE_M)
        for parity, colour in enumerate(_FLOOR_COLOURS):
            corners = [(x, y) for i, x in enumerate(steps) for j, y in enumerate(steps) if (i + j) % 2 == parity]
            vertices = [[x + dx, y + dy, 0.0] for x, y in corners
                        for dx, dy in ((0, 0), (_TILE_M, 0), (_TILE_M, _TILE_M), (0, _TILE_M))]
            indices = [4 * k + corner for k in range(len(corners)) for corner in (0, 1, 2, 0, 2, 3)]
            shape = pybullet.createVisualShape(pybullet.GEOM_MESH, vertices=vertices, indices=indices,
                                               normals=[[0.0, 0.0, 1.0]] * len(vertices), rgbaColor=list(colour),
                                               physicsClientId=self._client)
            bodies.append(pybullet.createMultiBody(baseVisualShapeIndex=shape, physicsClientId=self._client))
        return bodies
