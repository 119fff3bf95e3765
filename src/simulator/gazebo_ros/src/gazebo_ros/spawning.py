# SPDX-License-Identifier: BSD-3-Clause
"""Spawning and deleting of models: from a description to a model in the world with its plugins.

Slow work (parsing, importing plugins, finding files) happens in the thread of the request; the loop only makes the
bodies.
"""
from __future__ import annotations

import gc
import itertools
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from lxml import etree

from bullet_sim import BulletSimError, Pose, with_stand_ins
from bullet_sim.gathered import MAX_SHAPES
from bullet_sim.solids import with_solids
from bullet_sim.world import is_fixed
from gazebo_ros import urdf_extras
from gazebo_ros.drawn_sensor import DrawnSensor
from gazebo_ros.idle_elements import idle_elements, plugin_elements
from gazebo_ros.model_plugin import PluginContext, PluginError, PluginHost, PluginSource, with_tf_prefix
from gazebo_ros.plugin_table import PluginTable
from gazebo_ros.simulation import HostedPlugin
from gazebo_ros.world_lights import lights_of_links
from loop_ros.faults import SURVIVED, described
from loop_ros.names import IllegalName
from model_files.resources import ResourceFinder
from sdf_model import ModelFolders, SdfError, add_loops, parse_sdf_model
from urdf_model import Mesh, OutOfBounds, Plane, UrdfError, bounds, drawing_urdf, merge_fixed, parse_urdf
from world_picture.shared_picture import NoPicture, PictureWriter
from world_picture.snapshot import SnapshotError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from bullet_sim import Model
    from gazebo_ros.model_plugin import ModelPlugin
    from gazebo_ros.simulation import Simulation
    from loop_ros.protocol import Log, LoopRos
    from sdf_model import SdfModel
    from urdf_model import MergedRobot, Robot


class SpawnRefused(Exception):
    """The model cannot be made; the text says what was found and what would be right."""


@dataclass(eq=False)
class Prepared:
    """A description that the loop can turn into a model."""

    name: str
    #: The description as text; the :mod:`urdf_model` robot of it; the same with its fixed links merged.
    xml: str
    robot: Robot
    merged: MergedRobot
    #: URDF text for viewers, or None for a floor.
    drawing: str | None
    #: Joint name to start position [rad, m].
    start: dict[str, float]
    #: (class, element, namespace) of each plugin; the data for the renderer about sensors that need pictures, and about
    #: lights in links.
    plugins: list[tuple[type[ModelPlugin], Any, str]]
    sensors: list[dict[str, Any]]
    lights: list[dict[str, Any]]
    #: The tree of the parameter server, {} where no plugin needs it.
    parameters: dict[str, Any]
    #: Further arguments of ``World.spawn``.
    options: dict[str, Any]
    #: Which shapes replace meshes that could not be loaded, in one line; "" for none.
    mended: str
    #: Pose of the model in the frame that it is spawned in (4x4); an SDF may give one. None: identity.
    origin: np.ndarray | None = None


class SpawnLookups(NamedTuple):
    """The look-ups of a :class:`Spawner`: plugin classes, files, models of SDF."""

    plugins: PluginTable
    files: ResourceFinder
    models: ModelFolders


class Spawner:
    """Makes models and their plugins, and keeps the list for viewers."""

    def __init__(self, simulation: Simulation, library: SpawnLookups, ros: LoopRos, log: Log,
                 on_change: Callable[[], object], folder: str | Path | None = None) -> None:
        """``library``: :class:`SpawnLookups`; ``on_change()``: models changed.

        ``folder``: where viewers find the pictures of screens.
        """
        self._simulation = simulation
        self._library = library
        self._ros = ros
        self._log = log
        self._on_change = on_change
        self._mesh_files = simulation.world.mesh_files
        #: What viewers draw for the models that were spawned here: {model name: URDF text, or None for a floor}.
        self.drawings: dict[str, str | None] = {}
        #: The sensors that need pictures, for the renderer: {model name: list of dictionaries}.
        self.sensors: dict[str, list[dict[str, Any]]] = {}
        #: The lights in their links, likewise.
        self.lights: dict[str, list[dict[str, Any]]] = {}
        # The screens that plugins have: {model name: list of (what the scene says, PictureWriter)}.
        self._screens: dict[str, list[tuple[dict[str, Any], PictureWriter]]] = {}
        self._folder = None if folder is None else Path(folder)
        self._number = itertools.count()

    def listed(self) -> list[dict[str, Any]]:
        """The scene's entry of each model of the world."""
        return [{"name": model.name, "joints": list(model.joint_names), "urdf": self.drawings.get(model.name),
                 "static": bool(model.static), "loose": bool(model.loose),
                 "sensors": self.sensors.get(model.name, []),
                 "lights": self.lights.get(model.name, []),
                 "screens": [entry for entry, _ in self._screens.get(model.name, [])]}
                for model in self._simulation.world.models.values()]

    def prepare(self, name: str, xml: str, namespace: str | None, parameters: Callable[[], dict[str, Any]]) -> Prepared:
        """Any thread but the loop's: read a URDF. Raises :class:`SpawnRefused`.

        ``parameters``: function that returns the tree of the parameter server; called when a plugin needs it.
        """
        self._check_name(name)
        try:
            robot = parse_urdf(xml, source="the description of '%s'" % name)
        except UrdfError as error:
            raise SpawnRefused(str(error)) from error
        self._warn(name, idle_elements(robot, "its description"))
        add_loops(robot)
        return self.prepare_robot(name, xml, robot, namespace, parameters, drawing=xml)

    def prepare_sdf(self, name: str, xml: str, namespace: str | None,
                    parameters: Callable[[], dict[str, Any]]) -> Prepared:
        """Any thread but the loop's: read an SDF with one model. Raises :class:`SpawnRefused`."""
        self._check_name(name)
        try:
            found = parse_sdf_model(xml, "the description of '%s'" % name, self._library.models)
        except SdfError as error:
            raise SpawnRefused(str(error)) from error
        self._warn(name, "; ".join(filter(None, (found.warning, plugin_elements([found.robot], "its description")))))
        prepared = self.prepare_robot(name, xml, found.robot, namespace, parameters)
        prepared.origin = found.pose
        return prepared

    def prepare_robot(self, name: str, xml: str, robot: Robot, namespace: str | None,
                      parameters: Callable[[], dict[str, Any]], drawing: str | None = None) -> Prepared:
        """Any thread but the loop's: the same for a ``urdf_model.Robot`` that has been read from ``xml``.

        ``namespace``: None for a model of a world file; ``drawing``: URDF text for viewers where there is one already.
        """
        self._check_name(name)
        try:
            start = urdf_extras.start_configuration(robot, self._log.warn)
            plugins, sensors, options = self._plugins(name, robot, namespace)
        except (urdf_extras.ExtrasError, PluginError) as error:
            raise SpawnRefused(str(error)) from error
        for warning in robot.warnings:
            self._log.warn(warning)
        # Reads every mesh, so that the loop finds its converted form, which loads quickly.
        self._library.files.forget_missing()
        robot, mended = with_stand_ins(robot, self._mesh_files)
        if mended:
            if "cannot be found" in mended:
                mended += " (are the files there, and the packages in ROS_PACKAGE_PATH?)"
            self._log.warn("model '%s': %s" % (name, mended))
        options = {"static": urdf_extras.is_static(robot), **options}
        try:
            merged = merge_fixed(with_solids(robot, options.pop("solids", None)), held=bool(options["static"]))
        except BulletSimError as error:
            raise SpawnRefused(str(error)) from error
        if mended or drawing is None:
            drawing = None if is_floor(robot) else drawing_urdf(merged)
        stands_fast = is_fixed(merged.root, options["static"])
        for link in _slow_bodies(merged):
            self._mesh_files.parts(merged.links[link].collisions, stands_fast and link == merged.root,
                                   options.get("mesh_cuts"))
        tree = parameters() if plugins or sensors else {}
        sensors = [_drawn(merged, *sensor) for sensor in sensors]
        for sensor in sensors:
            sensor["frame"] = with_tf_prefix(tree, sensor["namespace"], sensor["frame"])
        return Prepared(name=name, xml=xml, robot=robot, merged=merged, drawing=drawing, start=start, plugins=plugins,
                        sensors=sensors, lights=lights_of_links(robot, merged, self._log.warn),
                        parameters=tree, options=options, mended=mended)

    def make_shapes(self, prepared: Prepared) -> None:
        """Any thread but the loop's, while that runs: let the loop make a model's slow shapes, one per turn.

        Raises ``BulletSimError``.
        """
        static, cuts = prepared.options.get("static"), prepared.options.get("mesh_cuts")
        for link in _slow_bodies(prepared.merged):
            self._simulation.requests.call(self._simulation.world.make_shape, prepared.merged, link, static, cuts)

    def spawn(self, prepared: Prepared, pose: Pose) -> None:
        """Loop thread: make the model at ``pose`` and start its plugins. Raises :class:`SpawnRefused`."""
        world = self._simulation.world
        try:
            if prepared.origin is not None:
                pose = Pose.from_matrix(pose.checked().matrix() @ prepared.origin)
            model = world.spawn(prepared.robot, prepared.name, pose, merged=prepared.merged, **prepared.options)
        except BulletSimError as error:
            raise SpawnRefused(str(error)) from error
        try:
            self._set_start(model, prepared.start)
            self.drawings[prepared.name] = prepared.drawing
            self.sensors[prepared.name] = prepared.sensors
            self.lights[prepared.name] = prepared.lights
            for plugin_class, element, namespace in prepared.plugins:
                self._start_plugin(prepared, model.name, plugin_class, element, namespace)
        except (SpawnRefused, PluginError, BulletSimError) as error:
            self._remove(prepared.name)
            raise SpawnRefused(str(error)) from error
        except SURVIVED:
            self._remove(prepared.name)
            raise
        self._on_change()
        # Keep the model's objects out of garbage collections: they live as long as the model.
        gc.freeze()

    def spawn_world(self, models: Sequence[SdfModel]) -> None:
        """Loop thread, before it runs: make the models of a world (``sdf_model.SdfModel``); logs those that fail."""
        said = plugin_elements([found.robot for found in models], "the world or a model")
        if said:
            self._log.warn("plugins: %s" % said)
        for found in models:
            try:
                prepared = self.prepare_robot(found.name, "", found.robot, None, dict)
                self.spawn(prepared, Pose.from_matrix(found.pose))
            except SURVIVED as error:
                why = str(error) if isinstance(error, SpawnRefused) else described(error)
                self._log.error("model '%s' of the world file: %s" % (found.name, why))

    def delete(self, name: str) -> None:
        """Loop thread: remove a model and its plugins. Raises ``BulletSimError`` when there is none of that name."""
        if name not in self._simulation.world.models:
            self._simulation.world.delete(name)  # raises, and knows the right text
        self._remove(name)
        self._on_change()

    def _remove(self, name: str) -> None:
        self._simulation.unhost(name)
        self._simulation.world.delete(name)
        self.drawings.pop(name, None)
        self.sensors.pop(name, None)
        self.lights.pop(name, None)
        for _, picture in self._screens.pop(name, []):
            picture.close()

    def _set_start(self, model: Model, start: dict[str, float]) -> None:
        names = list(start)
        index = model.index(names)
        wanted = np.array([start[name] for name in names])
        position = np.clip(wanted, model.lower[index], model.upper[index])
        for name, asked, got in zip(names, wanted, position, strict=True):
            if abs(asked - got) > 1e-3:
                self._log.warn("model '%s': joint %s cannot start at %g, its limit is %g"
                               % (model.name, name, asked, got))
        if names:
            model.set_joint_positions(index, position)
            model.mark_start()

    def _start_plugin(self, prepared: Prepared, model_name: str, plugin_class: type[ModelPlugin], element: Any,
                      namespace: str) -> None:
        simulation = self._simulation
        label = element.get("filename")
        # By name: an earlier plugin may have replaced the model by a fixed one.
        model = simulation.world.models[model_name]
        host = PluginHost(lambda *screen: self._add_screen(prepared, *screen),
                          lambda: [h.plugin for h in simulation.plugins if h.model_name == model_name])
        context = PluginContext(simulation.world, model, PluginSource(prepared.robot, element, namespace, prepared.xml),
                                self._log, self._ros, prepared.parameters, host)
        try:
            plugin = plugin_class(context)
        except (PluginError, IllegalName) as error:
            context.close()
            if plugin_class.required:
                raise SpawnRefused("plugin '%s': %s" % (label, error)
                                   if isinstance(error, IllegalName) else str(error)) from error
            self._leave_out(model_name, error)
            return
        except SURVIVED:
            context.close()
            raise
        simulation.host(HostedPlugin(plugin, context, model_name, label))

    def _add_screen(self, prepared, link, place, size_m, pixels, glows, radius_m):
        frames = prepared.merged.frames
        if link not in frames:
            raise PluginError("a screen is on link '%s', which '%s' does not have" % (link, prepared.robot.name))
        if self._folder is None:
            return NoPicture()
        try:
            picture = PictureWriter(self._folder / ("screen%d" % next(self._number)), *pixels)
        except SnapshotError as error:
            self._log.error(str(error))
            return NoPicture()
        entry = {"link": frames[link].link, "offset": (frames[link].offset @ place).ravel().tolist(),
                 "size": list(size_m), "picture": str(picture.path), "glows": glows, "radius": radius_m}
        self._screens.setdefault(prepared.name, []).append((entry, picture))
        return picture

    def _plugins(self, name, robot, spawn_namespace):
        found, sensors, options, unknown = [], [], {}, Counter()
        for element in (*urdf_extras.plugins(robot), *urdf_extras.sensor_plugins(robot, self._log.warn),
                        *urdf_extras.visual_plugins(robot)):
            filename = element.get("filename") or ""
            plugin_class = self._library.plugins.find(filename)
            if plugin_class is None:
                unknown[filename] += 1
                continue
            asked, named = spawn_namespace, plugin_class.named_after_model
            if element.find("robotNamespace") is not None:
                # Gazebo gives a model's namespace to plugins without the element alone.
                asked, named = "", named or plugin_class.named_if_empty
            if named and not asked and re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
                asked = name
            namespace = urdf_extras.namespace_of(element, asked)
            if issubclass(plugin_class, DrawnSensor):
                sensor, link = urdf_extras.sensor_of(element)
                if sensor is None or link is None:
                    self._leave_out(robot.name, "plugin '%s' stands outside of a <sensor>; expected "
                                    "<gazebo reference=\"LINK\"><sensor><plugin>" % filename)
                else:
                    sensors.append((sensor, link, element, namespace))
                continue
            options.update(plugin_class.spawn_options(robot, element))
            found.append((plugin_class, element, namespace))
        if unknown:
            names = ", ".join("'%s'%s" % (plugin, " (%d times)" % count if count > 1 else "")
                              for plugin, count in unknown.items())
            self._log.warn("model '%s': plugins that are not known here and are left out: %s; known plugins: %s"
                           % (name, names, ", ".join(self._library.plugins.known)))
        return found, sensors, options

    def _warn(self, name: str, text: str) -> None:
        if text:
            self._log.warn("model '%s': %s" % (name, text))

    def _leave_out(self, model_name: str, error: PluginError | IllegalName | str) -> None:
        self._log.warn("model '%s' comes without one of its sensors: %s" % (model_name, error))

    def _check_name(self, name: str) -> None:
        if not name:
            raise SpawnRefused("the model needs a name (model_name is empty)")
        try:
            bounds.check_name(name, "the model's name")
        except OutOfBounds as error:
            raise SpawnRefused(str(error)) from error
        if name in self.drawings:
            raise SpawnRefused("entity already exists: delete the model '%s' first or choose another name" % name)


def _slow_bodies(merged: MergedRobot) -> list[str]:
    """The names of the bodies whose collision shape is a file: a mesh, or the file that gathers more shapes than
    PyBullet takes."""
    return [link.name for link in merged.links.values() if len(link.collisions) > MAX_SHAPES
            or any(isinstance(shape.geometry, Mesh) for shape in link.collisions)]


def _drawn(merged: MergedRobot, sensor: Any, link: str, plugin: Any, namespace: str) -> dict[str, Any]:
    """The scene's entry of the plugin of a ``<sensor>`` on ``link`` that needs pictures."""
    frame = merged.frames[link]
    return {"link": frame.link, "offset": frame.offset.ravel().tolist(),
            "frame": (plugin.findtext("frameName") or "").strip() or link,
            "xml": etree.tostring(sensor, encoding="unicode", with_tail=False),
            "plugin": sensor.findall("plugin").index(plugin), "namespace": namespace}


def is_floor(robot: Robot) -> bool:
    """Whether a ``urdf_model.Robot`` is only a ground plane."""
    shapes = [shape for link in robot.links.values() for shape in (*link.visuals, *link.collisions)]
    return bool(shapes) and all(isinstance(shape.geometry, Plane) for shape in shapes)
