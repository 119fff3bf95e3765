# SPDX-License-Identifier: BSD-3-Clause
"""The camera of an SDF ``<sensor>`` element, and the topics of its ``<plugin>``. ROS-free."""
from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from lxml import etree

from sensor_renderer.errors import SensorError
from sensor_renderer.lens import Distortion, Lens
from sensor_renderer.pinhole import OPTICAL, Pinhole
from urdf_model.transforms import pose_matrix

if TYPE_CHECKING:
    from sensor_renderer.moments import Moment

# SDF's defaults.
_WIDTH, _HEIGHT, _FIELD_RAD = 320, 240, 1.047
_NEAR_M, _FAR_M = 0.1, 100.0
_FORMATS = {"R8G8B8": "rgb8", "B8G8R8": "bgr8", "L8": "mono8", "RGB_INT8": "rgb8", "BGR_INT8": "bgr8",
            "L_INT8": "mono8"}


class CameraElement(NamedTuple):
    """One camera of a ``<sensor>``.

    ``offset`` (4, 4): its optical frame in the frame of the link; ``encoding`` of its images as ROS names it;
    ``noise`` and ``noise_mean`` [of 1.0 for full brightness] are standard deviation and mean of the noise of each
    pixel; ``lens``: a :class:`sensor_renderer.lens.Lens` if it distorts, with these coefficients, else None.
    """

    name: str
    pinhole: Pinhole
    offset: np.ndarray
    encoding: str
    noise: float
    distortion: Distortion = Distortion()
    lens: Lens | None = None
    noise_mean: float = 0.0

    def view(self, moment: Moment, colour: bool, depth: bool) -> tuple[np.ndarray | None, np.ndarray | None]:
        """(picture, depth) as this camera sees them at a :class:`sensor_renderer.moments.Moment`; None if not
        requested."""
        if self.lens is None:
            return moment.draw(self.pinhole, self.offset, colour, depth)
        picture, distance = moment.draw(self.lens.ideal, self.offset, colour, depth)
        return (None if picture is None else self.lens.picture(picture),
                None if distance is None else self.lens.nearest(distance))

    def identified(self, moment: Moment) -> tuple[np.ndarray, list[tuple[str, int]], np.ndarray]:
        """(numbers, links, depth) as :meth:`GlRenderer.identify` returns them, of this camera."""
        if self.lens is None:
            return moment.identify(self.pinhole, self.offset)
        numbers, links, distance = moment.identify(self.lens.ideal, self.offset)
        return self.lens.nearest(numbers), links, self.lens.nearest(distance)

    @property
    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """x / z and y / z, (height, width) each, of the pixels."""
        if self.lens is not None:
            return self.lens.rays
        pinhole = self.pinhole
        columns, rows = np.meshgrid(np.arange(pinhole.width), np.arange(pinhole.height))
        return (columns - pinhole.cx) / pinhole.fx, (rows - pinhole.cy) / pinhole.fy

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points (n, 3) [m] in the optical frame, through the lens."""
        if self.lens is None:
            return self.pinhole.project(points)
        arrivals = self.distortion.distorted(points[:, :2] / points[:, 2:])
        return arrivals * (self.pinhole.fx, self.pinhole.fy) + (self.pinhole.cx, self.pinhole.cy)


class SensorEntry:
    """A ``<sensor>`` with its ``<plugin>``, as the simulator lists it in its scene."""

    def __init__(self, model: str, listed: Mapping[str, Any]) -> None:
        """``listed``: ``link`` (a body of the model), ``offset`` (16 numbers, link frame in the body's), ``frame``
        (of its messages), ``xml`` (the element), ``plugin`` (which of its plugins), ``namespace``.

        Raises :class:`SensorError`.
        """
        self.model = model
        self.link = listed["link"]
        self.frame = listed["frame"]
        self.offset = np.array(listed["offset"], dtype=float).reshape(4, 4)
        self.namespace = listed["namespace"]
        self.element = etree.fromstring(listed["xml"])
        self.plugin = self.element.findall("plugin")[listed["plugin"]]
        self.filename = self.plugin.get("filename", "").rsplit("/", 1)[-1]
        self.name = self.element.get("name") or self.plugin.get("name") or "camera"
        rate = self.number(self.plugin, "updateRate", 0.0) or self.number(self.element, "update_rate", 0.0)
        #: Rate [Hz, simulation time]; 0: one picture per state.
        self.rate = max(rate, 0.0)

    def __str__(self):
        return "sensor '%s' of model '%s'" % (self.name, self.model)

    def text(self, tag: str, default: str) -> str:
        """Stripped text of the plugin's child ``tag``, or ``default`` where it is missing or empty."""
        return (self.plugin.findtext(tag) or "").strip() or default

    def number(self, element: etree._Element, path: str, default: float) -> float:
        """A number in a child; raises :class:`SensorError`."""
        text = (element.findtext(path) or "").strip()
        try:
            value = float(text) if text else default
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise SensorError("%s: <%s> is '%s', expected a number" % (self, path, text))
        return value

    def baseline_m(self, camera: CameraElement) -> float:
        """The distance to the left camera in the projection of ``camera`` (a CameraElement), ``hackBaseline``: of
        several cameras, those that are not the right one have none."""
        alone = len(self.element.findall("camera")) < 2
        return self.number(self.plugin, "hackBaseline", 0.0) if alone or "right" in camera.name else 0.0

    def cameras(self) -> list[CameraElement]:
        """The list of :class:`CameraElement`, one with SDF's defaults where no <camera> is; raises :class:`SensorError`
        for impossible ones."""
        found = self.element.findall("camera") or [etree.Element("camera")]
        return [self._camera(camera, number) for number, camera in enumerate(found)]

    def stated(self, pinhole: Pinhole) -> Pinhole:
        """The :class:`Pinhole` that ``camera_info`` states: with the plugin's ``focalLength``, ``Cx`` and ``Cy``
        [pixels] where they are not 0. As in Gazebo, the picture is that of ``pinhole`` all the same."""
        focal, cx, cy = (self.number(self.plugin, tag, 0.0) for tag in ("focalLength", "Cx", "Cy"))
        return pinhole._replace(fx=focal or pinhole.fx, fy=focal or pinhole.fy, cx=cx or pinhole.cx,
                                cy=cy or pinhole.cy)

    def _camera(self, camera, number):
        try:
            pinhole = Pinhole.from_field_of_view(
                round(self.number(camera, "image/width", _WIDTH)), round(self.number(camera, "image/height", _HEIGHT)),
                self.number(camera, "horizontal_fov", _FIELD_RAD), self.number(camera, "clip/near", _NEAR_M),
                self.number(camera, "clip/far", _FAR_M))
        except SensorError as error:
            raise SensorError("%s: %s" % (self, str(error).split(": ", 1)[-1])) from error
        written = (camera.findtext("image/format") or "R8G8B8").strip().upper()
        if written not in _FORMATS:
            raise SensorError("%s: image format '%s' is not known; expected one of %s"
                              % (self, written, ", ".join(_FORMATS)))
        distortion = self._distortion(camera)
        try:
            lens = Lens(pinhole, distortion) if any(distortion) else None
        except SensorError as error:
            raise SensorError("%s: %s" % (self, error)) from error
        noise, mean = self._noise(camera)
        offset = self.offset @ self._pose(self.element) @ self._pose(camera) @ OPTICAL
        return CameraElement(camera.get("name") or "camera%d" % number, pinhole, offset, _FORMATS[written],
                             noise, distortion, lens, mean)

    def _noise(self, camera):
        """(standard deviation, mean) of the camera's <noise>."""
        kind = (camera.findtext("noise/type") or "gaussian").strip().lower()
        if kind == "none":
            return 0.0, 0.0
        if kind != "gaussian":
            raise SensorError("%s: the <type> of its <noise> is '%s', expected gaussian or none" % (self, kind))
        deviation, mean = self.number(camera, "noise/stddev", 0.0), self.number(camera, "noise/mean", 0.0)
        if deviation < 0.0:
            raise SensorError("%s: <noise/stddev> is %g, expected 0 or more" % (self, deviation))
        return deviation, mean

    def _distortion(self, camera):
        """Of the camera's <distortion>; where there is none, of the plugin's, as older descriptions have it."""
        if camera.find("distortion") is not None:
            centre = (camera.findtext("distortion/center") or "0.5 0.5").split()
            if centre != ["0.5", "0.5"]:
                raise SensorError("%s: the <center> of its <distortion> is '%s', expected '0.5 0.5'"
                                  % (self, " ".join(centre)))
            return Distortion(*(self.number(camera, "distortion/" + name, 0.0) for name in Distortion._fields))
        return Distortion(*(self.number(self.plugin, "distortion" + name.upper(), 0.0)
                            for name in ("k1", "k2", "t1", "t2", "k3")))

    def _pose(self, element):
        words = (element.findtext("pose") or "").split()
        if not words:
            return np.eye(4)
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != 6 or not np.isfinite(values).all():
            raise SensorError("%s: <pose> is '%s', expected six numbers" % (self, " ".join(words)))
        return pose_matrix(values[:3], values[3:])
