# SPDX-License-Identifier: BSD-3-Clause
"""The services under /gazebo that are about lights. Nothing here is lit by them: the window has a light of its own."""
from gazebo_msgs.srv import (
    DeleteLight,
    DeleteLightResponse,
    GetLightProperties,
    GetLightPropertiesResponse,
    SetLightProperties,
    SetLightPropertiesResponse,
)
from std_msgs.msg import ColorRGBA


class LightServices:
    """Knows the lights of the world file and says what they are."""

    def __init__(self, lights, ros):
        """``lights``: list of ``sdf_model.Light``."""
        self._lights = {light.name: light for light in lights}
        for name, srv_class, handler in (("delete_light", DeleteLight, self._delete),
                                         ("get_light_properties", GetLightProperties, self._get),
                                         ("set_light_properties", SetLightProperties, self._set)):
            ros.service("/gazebo/" + name, srv_class, handler)

    def _missing(self, name):
        return "light '%s' does not exist; lights: %s" % (name, ", ".join(self._lights) or "none")

    def _get(self, request):
        light = self._lights.get(request.light_name)
        if light is None:
            return GetLightPropertiesResponse(status_message="GetLightProperties: %s"
                                              % self._missing(request.light_name))
        return GetLightPropertiesResponse(ColorRGBA(*light.diffuse), *light.attenuation, True,
                                          "GetLightProperties: got properties")

    def _set(self, request):
        if request.light_name not in self._lights:
            return SetLightPropertiesResponse(False, "SetLightProperties: %s" % self._missing(request.light_name))
        return SetLightPropertiesResponse(False, "SetLightProperties: lights have no effect here, the window has one "
                                                 "of its own; light '%s' stays as it is" % request.light_name)

    def _delete(self, request):
        if self._lights.pop(request.light_name, None) is None:
            return DeleteLightResponse(False, "DeleteLight: %s" % self._missing(request.light_name))
        return DeleteLightResponse(True, "DeleteLight: successfully deleted light")
