# SPDX-License-Identifier: BSD-3-Clause
"""The shaders, and the programs compiled from them. ROS-free."""
import numpy as np

from sensor_renderer.light import MOST_LAMPS, Lamp

_NO_LAMP = Lamp((0.0,) * 4, (0.0,) * 3, (0.0,) * 4, (0.0,) * 3, (0.0,) * 3)

# Light without shadows, of up to MOST_LAMPS lamps. In software, even an empty loop costs as much as the rest of a
# picture: without lamps, the shaders have no such loop.
_NO_LAMPS = """
#version 330
vec3 lamplight(vec3 there, vec3 n) { return vec3(0.0); }
"""

_LAMPS = """
#version 330
uniform int lamps;
uniform vec4 lamp_place[%d];
uniform vec3 lamp_colour[%d];
uniform vec4 lamp_fade[%d];
uniform vec3 lamp_beam[%d];
uniform vec3 lamp_cone[%d];
vec3 lamplight(vec3 there, vec3 n) {
    vec3 sum = vec3(0.0);
    for (int k = 0; k < lamps; ++k) {
        vec3 ray = lamp_place[k].xyz - lamp_place[k].w * there;
        vec3 to_lamp = ray / max(length(ray), 1e-6);
        float away = lamp_place[k].w * length(ray);
        vec4 fade = lamp_fade[k];
        vec3 cone = lamp_cone[k];
        float part = clamp((dot(-to_lamp, lamp_beam[k]) - cone.y) / (cone.x - cone.y), 0.0, 1.0);
        float strength = pow(part, cone.z) / max(fade.x + away * (fade.y + away * fade.z), 1e-6);
        sum += lamp_colour[k] * max(dot(n, to_lamp), 0.0) * (away > fade.w ? 0.0 : strength);
    }
    return sum;
}
""" % ((MOST_LAMPS,) * 5)

# Light is computed per vertex and only shadow per pixel: without a graphics card, pixels are expensive. The floor has
# only four corners, so its lamps are computed per pixel.
_VERTEX = """
uniform vec3 ambient;
uniform vec3 sun;
uniform mat4 body;
uniform mat4 to_clip;
uniform mat4 to_shadow;
uniform vec3 eye;
uniform vec3 to_sun;
in vec3 position;
in vec3 normal;
in vec3 colour;
out vec3 dim;
out vec3 bright;
out vec3 shadow_place;
out vec3 place;
out vec3 own;
void main() {
    vec4 there = body * vec4(position, 1.0);
    vec3 n = mat3(body) * normal;
    // Thinned meshes are not closed everywhere: both sides of a triangle are outside.
    n = dot(n, eye - there.xyz) < 0.0 ? -n : n;
    own = colour;
    dim = colour * (ambient * (1.1 + 0.3 * n.z) + LAMPLIGHT);
    bright = colour * sun * max(dot(n, to_sun), 0.0);
    // 12 mm out of the surface and 4 mm towards the sun: more than a pixel of the map; else lit surfaces are specked.
    shadow_place = (to_shadow * (there + vec4(0.012 * n, 0.0))).xyz - vec3(0.0, 0.0, 0.001);
    place = there.xyz;
    gl_Position = to_clip * there;
}
"""

_FRAGMENT = """
#version 330
uniform sampler2DShadow shadow;
in vec3 dim;
in vec3 bright;
in vec3 shadow_place;
out vec4 seen;
void main() { seen = vec4(dim + bright * texture(shadow, shadow_place), 1.0); }
"""

_FLOOR_FRAGMENT = """
uniform sampler2DShadow shadow;
in vec3 dim;
in vec3 bright;
in vec3 shadow_place;
in vec3 place;
in vec3 own;
out vec4 seen;
void main() {
    vec2 tile = fract(place.xy) - 0.5;
    vec3 light = dim + bright * texture(shadow, shadow_place);
    light += own * lamplight(place, vec3(0.0, 0.0, 1.0));
    seen = vec4(light * (tile.x * tile.y > 0.0 ? 1.0 : 0.92), 1.0);
}
"""

_SHADOW_VERTEX = """
#version 330
uniform mat4 body;
uniform mat4 to_clip;
in vec3 position;
void main() { gl_Position = to_clip * (body * vec4(position, 1.0)); }
"""

_SHADOW_FRAGMENT = """
#version 330
void main() {}
"""


_SCREEN_VERTEX = """
#version 330
uniform mat4 body;
uniform mat4 to_clip;
in vec2 corner;
out vec2 place;
void main() {
    place = vec2(0.5 + corner.x, 0.5 - corner.y);
    gl_Position = to_clip * (body * vec4(corner, 0.0, 1.0));
}
"""

_SCREEN_FRAGMENT = """
#version 330
uniform sampler2D picture;
in vec2 place;
out vec4 seen;
void main() { seen = texture(picture, place); }
"""


class Programs:
    """The programs of one context. ``surface`` draws everything but the floor, ``floor`` the floor, ``shadow`` depth
    alone, ``screen`` a picture on a rectangle."""

    def __init__(self, context):
        """Compiles all but ``surface`` and ``floor``, which :meth:`light_by` compiles."""
        self._context = context
        self.screen = context.program(vertex_shader=_SCREEN_VERTEX, fragment_shader=_SCREEN_FRAGMENT)
        self.shadow = context.program(vertex_shader=_SHADOW_VERTEX, fragment_shader=_SHADOW_FRAGMENT)
        self.surface = self.floor = None
        self._with_lamps = None

    def fit(self, light):
        """Whether ``surface`` and ``floor`` are the ones for ``light`` already."""
        return self._with_lamps == bool(light.lamps)

    def compile(self, light):
        """Make ``surface`` and ``floor`` for ``light``; vertex arrays of the old ones must have been released."""
        for old in (self.surface, self.floor):
            if old is not None:
                old.release()
        self._with_lamps = bool(light.lamps)
        lamps = _LAMPS if light.lamps else _NO_LAMPS
        corners = _VERTEX.replace("LAMPLIGHT", "lamplight(there.xyz, n)")
        self.surface = self._context.program(vertex_shader=lamps + corners, fragment_shader=_FRAGMENT)
        corners = _NO_LAMPS + _VERTEX.replace("LAMPLIGHT", "0.0")
        self.floor = self._context.program(vertex_shader=corners, fragment_shader=lamps + _FLOOR_FRAGMENT)

    def light_by(self, light, to_shadow):
        """Set the uniforms of ``light``; ``to_shadow`` (4, 4): from the world to the shadow map's texture."""
        for program in (self.surface, self.floor):
            program["ambient"].value, program["sun"].value = light.ambient, light.sun
            program["to_sun"].value = light.to_sun
            program["to_shadow"].write(matrix_bytes(to_shadow))
            if not light.lamps:
                continue
            program["lamps"].value = len(light.lamps)
            for name in Lamp._fields:
                values = np.zeros((MOST_LAMPS, len(getattr(_NO_LAMP, name))), dtype=np.float32)
                for row, lamp in zip(values, light.lamps, strict=False):
                    row[:] = getattr(lamp, name)
                program["lamp_" + name].write(values.tobytes())


def matrix_bytes(matrix):
    """A (4, 4) matrix column by column, as OpenGL reads it."""
    return np.asarray(matrix, dtype=np.float32).T.tobytes()


def draw(program, listed):
    """Render ``listed``, (vertex array, matrix of the body as OpenGL reads it)."""
    body = program["body"]
    for array, packed in listed:
        body.write(packed)
        array.render()
