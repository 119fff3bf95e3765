# SPDX-License-Identifier: BSD-3-Clause
"""The services under /gazebo about lights. Cameras render with all lights; the window follows the direction of the
sun."""
from __future__ import annotations

from typing import TYPE_CHECKING

from gazebo_msgs.srv import (
    DeleteLight,
    DeleteLightResponse,
    GetLightProperties,
    GetLightPropertiesResponse,
    SetLightProperties,
    SetLightPropertiesResponse,
)
from std_msgs.msg import ColorRGBA

from bullet_sim import BulletSimError
from gazebo_ros.convert import pose_from_msg
from gazebo_ros.entities import UnknownEntity

if TYPE_CHECKING:
    from gazebo_ros.world_lights import WorldLights
    from loop_ros.protocol import LoopRos


class LightServices:
    """Reads and changes the world's lights."""

    def __init__(self, lights: WorldLights, ros: LoopRos) -> None:
        """``lights``: :class:`gazebo_ros.world_lights.WorldLights`."""
        self._lights = lights
        for name, srv_class, handler in (("delete_light", DeleteLight, self._delete),
                                         ("get_light_properties", GetLightProperties, self._get),
                                         ("set_light_properties", SetLightProperties, self._set)):
            ros.service("/gazebo/" + name, srv_class, handler)

    def _get(self, request):
        try:
            light = self._lights.get(request.light_name)
        except UnknownEntity as error:
            return GetLightPropertiesResponse(status_message="GetLightProperties: %s" % error)
        return GetLightPropertiesResponse(ColorRGBA(*light.diffuse), *light.attenuation, True,
                                          "GetLightProperties: got properties")

    def _set(self, request):
        def colour(message):
            return message.r, message.g, message.b, message.a

        try:
            # Requests of clients that know only the older fields have zeros in place of a direction and a pose.
            values = {"cast_shadows": request.cast_shadows}
            direction, q = request.direction, request.pose.orientation
            if direction.x or direction.y or direction.z:
                values["direction"] = (direction.x, direction.y, direction.z)
            if q.x or q.y or q.z or q.w:
                values["pose"] = pose_from_msg(request.pose).matrix()
            self._lights.change(
                request.light_name, diffuse=colour(request.diffuse), specular=colour(request.specular),
                attenuation=(request.attenuation_constant, request.attenuation_linear, request.attenuation_quadratic),
                **values)
        except (UnknownEntity, BulletSimError, ValueError) as error:
            return SetLightPropertiesResponse(False, "SetLightProperties: %s" % error)
        return SetLightPropertiesResponse(True, "SetLightProperties: attributes set")

    def _delete(self, request):
        try:
            self._lights.delete(request.light_name)
        except UnknownEntity as error:
            return DeleteLightResponse(False, "DeleteLight: %s" % error)
        return DeleteLightResponse(True, "DeleteLight: successfully deleted light")
