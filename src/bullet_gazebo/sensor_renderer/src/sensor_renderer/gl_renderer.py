# SPDX-License-Identifier: BSD-3-Clause
"""Pictures with OpenGL on EGL: no display needed, a graphics card used where there is one. ROS-free.

Everything here belongs to the thread that made the renderer.
"""
import os
import weakref
from dataclasses import dataclass

import numpy as np

from sensor_renderer.errors import RenderingError
from sensor_renderer.light import MOST_LAMPS, Lamp

# Size of the shadow map around the robots' workspace [m], and pixels per side: 9 mm each.
_SHADOW_CENTRE = np.array([0.3, 0.0, 0.7])
_SHADOW_HALF_M = 2.2
_SHADOW_PIXELS = 512
# A link of which the radius in the picture is larger than this [pixels] is drawn with its fine meshes: smaller ones
# would show no difference.
_FINE_FROM_PX = 40.0
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


@dataclass
class _Link:
    """The geometry of one draw call: vertex arrays for colour and for depth only, coarse and fine; a bounding sphere;
    its parts. The fine arrays are made when the link is first seen so near."""

    arrays: tuple
    centre: np.ndarray
    radius: float
    is_floor: bool
    parts: tuple = ()
    fine: tuple | None = None


class GlRenderer:
    """Draws a :class:`sensor_renderer.mirror.Mirror`."""

    def __init__(self):
        """Raises :class:`RenderingError` if EGL is not available."""
        # In software one thread: physics and the user's own programs need the other processors.
        os.environ.setdefault("LP_NUM_THREADS", "1")
        try:
            import moderngl

            self._context = moderngl.create_context(standalone=True, backend="egl", require=330)
        except Exception as error:  # noqa: BLE001  (each layer below raises its own kind)
            raise RenderingError("no OpenGL 3.3 on EGL: %s" % error) from error
        context = self._context
        #: Name of the renderer, as the driver gives it.
        self.name = context.info["GL_RENDERER"]
        self._screen_program = context.program(vertex_shader=_SCREEN_VERTEX, fragment_shader=_SCREEN_FRAGMENT)
        corners = np.array([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)], dtype=np.float32)
        self._screen = context.vertex_array(self._screen_program, [(context.buffer(corners.tobytes()), "2f", "corner")])
        self._screen_program["picture"].value = 1
        self._strip = moderngl.TRIANGLE_STRIP
        self._smooth = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        self._pictures = {}
        self._shadow_program = context.program(vertex_shader=_SHADOW_VERTEX, fragment_shader=_SHADOW_FRAGMENT)
        self._shadow_map = context.depth_texture((_SHADOW_PIXELS, _SHADOW_PIXELS))
        self._shadow_map.compare_func = "<="
        # Between four comparisons: edges are soft.
        self._shadow_map.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._shadow_map.repeat_x = self._shadow_map.repeat_y = False
        self._shadow_buffer = context.framebuffer(depth_attachment=self._shadow_map)
        self._links = {}
        self._links_of = weakref.WeakKeyDictionary()
        self._buffers = {}
        self._shadow_of = None
        self._lit_by = self._shadow_matrix = self._program = self._floor_program = None
        context.enable(moderngl.DEPTH_TEST)

    def render(self, mirror, pinhole, pose, colour=True, depth=False):
        """Draw the view of a camera whose optical frame is at ``pose`` (4, 4) in the world.

        Returns (picture, depth): uint8 (height, width, 3) red, green, blue, and float32 (height, width) metres along
        the optical z axis, NaN where nothing is; None if not requested. The caller owns both arrays.
        """
        view = np.linalg.inv(pose)
        to_clip = pinhole.clip_matrix() @ view
        if mirror.light != self._lit_by:
            self._light_by(mirror.light)
        seen = [(self._arrays(link, matrix, pinhole, view), packed, link.is_floor)
                for link, matrix, packed in _visible(self._everything(mirror), pinhole, view)]
        buffer, depth_texture = self._framebuffer(pinhole.width, pinhole.height)
        picture = distance = None
        if colour:
            self._draw_shadows(mirror)
            screens = self._screens(mirror, pinhole, view)
            buffer.use()
            buffer.clear(*mirror.light.background, 1.0, depth=1.0)
            self._shadow_map.use(0)
            for program, floor in ((self._program, False), (self._floor_program, True)):
                program["to_clip"].write(_bytes(to_clip))
                program["eye"].value = tuple(pose[:3, 3])
                self._draw(program, [(arrays[0], packed) for arrays, packed, is_floor in seen if is_floor == floor])
            if screens:
                self._screen_program["to_clip"].write(_bytes(to_clip))
            for texture, matrix in screens:
                texture.use(1)
                self._screen_program["body"].write(_bytes(matrix))
                self._screen.render(self._strip)
            picture = np.frombuffer(buffer.read(components=3, alignment=1), np.uint8)
            picture = picture.reshape(pinhole.height, pinhole.width, 3)
        else:
            buffer.use()
            buffer.clear(depth=1.0)
            self._shadow_program["to_clip"].write(_bytes(to_clip))
            self._draw(self._shadow_program, [(arrays[1], packed) for arrays, packed, _ in seen])
        if depth:
            raw = np.frombuffer(depth_texture.read(alignment=1), np.float32)
            distance = pinhole.depth_from_buffer(raw.reshape(pinhole.height, pinhole.width))
        return picture, distance

    def close(self):
        """Release the context."""
        self._context.release()

    def _light_by(self, light):
        if self._lit_by is None or bool(light.lamps) != bool(self._lit_by.lamps):
            self._compile(_LAMPS if light.lamps else _NO_LAMPS)
        self._lit_by, self._shadow_of = light, None
        self._shadow_matrix, to_shadow = _shadow_matrices(np.array(light.to_sun))
        for program in (self._program, self._floor_program):
            program["ambient"].value, program["sun"].value = light.ambient, light.sun
            program["to_sun"].value = light.to_sun
            program["to_shadow"].write(_bytes(to_shadow))
            if not light.lamps:
                continue
            program["lamps"].value = len(light.lamps)
            for name in Lamp._fields:
                values = np.zeros((MOST_LAMPS, len(getattr(_NO_LAMP, name))), dtype=np.float32)
                for row, lamp in zip(values, light.lamps, strict=False):
                    row[:] = getattr(lamp, name)
                program["lamp_" + name].write(values.tobytes())

    def _compile(self, lamps):
        for drawn in (*(array for link in self._links.values() for array in (*link.arrays, *(link.fine or ()))),
                      self._program, self._floor_program):
            if drawn is not None:
                drawn.release()
        self._links = {}
        self._links_of.clear()
        corners = _VERTEX.replace("LAMPLIGHT", "lamplight(there.xyz, n)")
        self._program = self._context.program(vertex_shader=lamps + corners, fragment_shader=_FRAGMENT)
        corners = _NO_LAMPS + _VERTEX.replace("LAMPLIGHT", "0.0")
        self._floor_program = self._context.program(vertex_shader=corners, fragment_shader=lamps + _FLOOR_FRAGMENT)

    def _screens(self, mirror, pinhole, view):
        """The screens that show their faces: (texture, matrix of a square of 1 m)."""
        found = []
        for body in mirror.bodies.values():
            for screen in body.screens:
                matrix = body.link_matrix(screen.link) @ screen.offset
                face = _Link((), np.zeros(3), float(np.hypot(*screen.size)) / 2.0, False)
                local = view @ matrix
                if local[:3, 2] @ local[:3, 3] < 0.0 and _visible([(face, matrix, None)], pinhole, view):
                    found.append((self._texture(mirror, screen.picture), matrix @ np.diag([*screen.size, 1.0, 1.0])))
        return found

    def _texture(self, mirror, picture):
        texture = self._pictures.get(picture)
        if texture is None:
            there = {screen.picture for body in mirror.bodies.values() for screen in body.screens}
            for gone in self._pictures.keys() - there:
                self._pictures.pop(gone).release()
            texture = self._pictures[picture] = self._context.texture((picture.width, picture.height), 3, alignment=1)
            texture.filter = self._smooth
            texture.repeat_x = texture.repeat_y = False
        pixels = picture.read()
        if pixels is not None:
            texture.write(pixels.tobytes(), alignment=1)
            texture.build_mipmaps()
        return texture

    def _draw_shadows(self, mirror):
        # Not by id(): a new object often gets the address of a deleted one.
        now = (weakref.ref(mirror), mirror.version)
        if self._shadow_of == now:
            return
        self._shadow_of = now
        self._shadow_buffer.use()
        self._shadow_buffer.clear(depth=1.0)
        if not mirror.light.shadows:
            return
        self._shadow_program["to_clip"].write(_bytes(self._shadow_matrix))
        self._draw(self._shadow_program, [(link.arrays[1], packed) for link, _, packed in self._everything(mirror)
                                          if not link.is_floor])

    @staticmethod
    def _draw(program, listed):
        body = program["body"]
        for array, packed in listed:
            body.write(packed)
            array.render()

    def _everything(self, mirror):
        """The links to draw: (:class:`_Link`, matrix, the same as OpenGL reads it), one for each link that has
        shapes."""
        found = []
        for body in mirror.bodies.values():
            links = self._links_of.get(body)
            if links is None:
                links = self._links_of[body] = [self._link(parts) if parts else None for parts in body.parts]
            packed = np.ascontiguousarray(body.matrices.transpose(0, 2, 1), dtype=np.float32)
            found += [entry for entry in zip(links, body.matrices, packed, strict=True) if entry[0] is not None]
        return found

    def _link(self, parts):
        key = tuple((part.key, part.colour) for part in parts)
        found = self._links.get(key)
        if found is None:
            rows = _rows(parts, [part.triangles for part in parts])
            is_floor = any(part.is_floor for part in parts)
            low, high = rows[:, :3].min(axis=0), rows[:, :3].max(axis=0)
            centre = (low + high) / 2.0
            radius = float(np.linalg.norm(rows[:, :3] - centre, axis=1).max())
            found = self._links[key] = _Link(self._arrays_of(rows, is_floor), centre, radius, is_floor, tuple(parts))
        return found

    def _arrays(self, link, matrix, pinhole, view):
        """The vertex arrays of the level of detail that the link's size in the picture asks for."""
        distance = np.linalg.norm((view @ matrix @ [*link.centre, 1.0])[:3])
        if link.radius * pinhole.fx <= _FINE_FROM_PX * distance or not any(part.fine for part in link.parts):
            return link.arrays
        if link.fine is None:
            rows = _rows(link.parts, [part.fine() if part.fine else part.triangles for part in link.parts])
            link.fine = self._arrays_of(rows, link.is_floor)
        return link.fine

    def _arrays_of(self, rows, is_floor):
        program = self._floor_program if is_floor else self._program
        return (self._vertex_array(program, rows, "3f 3f 3f", "position", "normal", "colour"),
                self._vertex_array(self._shadow_program, rows[:, :3], "3f", "position"))

    def _vertex_array(self, program, rows, layout, *names):
        """The GPU processes shared vertices once."""
        unique, index = np.unique(rows, axis=0, return_inverse=True)
        context = self._context
        return context.vertex_array(program, [(context.buffer(np.ascontiguousarray(unique).tobytes()), layout, *names)],
                                    context.buffer(index.astype(np.int32).tobytes()))

    def _framebuffer(self, width, height):
        if (width, height) not in self._buffers:
            depth = self._context.depth_texture((width, height))
            buffer = self._context.framebuffer(self._context.renderbuffer((width, height), 4), depth)
            self._buffers[width, height] = buffer, depth
        return self._buffers[width, height]


def _rows(parts, triangles):
    """(n, 9) position, normal, colour of the corners of all parts. One call draws a link: in software a call costs as
    much as some hundred triangles."""
    return np.concatenate([np.hstack([rows, np.tile(np.float32(part.colour[:3]), (len(rows), 1))])
                           for part, rows in zip(parts, triangles, strict=True)])


def _visible(listed, pinhole, view):
    """The entries of ``listed``, (:class:`_Link`, matrix, anything), whose spheres intersect the view frustum, near
    ones first."""
    # Outward normals of the four sides, in the optical frame; all go through the eye.
    left, right = -(pinhole.cx + 0.5) / pinhole.fx, (pinhole.width - 0.5 - pinhole.cx) / pinhole.fx
    top, bottom = -(pinhole.cy + 0.5) / pinhole.fy, (pinhole.height - 0.5 - pinhole.cy) / pinhole.fy
    sides = np.array([(-1.0, 0.0, left), (1.0, 0.0, -right), (0.0, -1.0, top), (0.0, 1.0, -bottom)])
    sides /= np.linalg.norm(sides, axis=1)[:, None]
    if not listed:
        return []
    matrices = np.array([matrix for _, matrix, _ in listed])
    centres = np.array([link.centre for link, _, _ in listed])
    radii = np.array([link.radius for link, _, _ in listed])
    world = np.einsum("nij,nj->ni", matrices[:, :3, :3], centres) + matrices[:, :3, 3]
    local = world @ view[:3, :3].T + view[:3, 3]
    inside = (local @ sides.T < radii[:, None]).all(axis=1)
    inside &= (local[:, 2] > pinhole.near - radii) & (local[:, 2] < pinhole.far + radii)
    # Near ones first: hidden pixels are not shaded.
    order = np.argsort(local[:, 2] - radii, kind="stable")
    return [listed[k] for k in order if inside[k]]


def _shadow_matrices(away):
    """Matrices from the world to the clip space of the light from direction ``away``, and to texture coordinates 0 to 1
    of its map."""
    right = np.cross((0.0, 1.0, 0.0) if abs(away[1]) < 0.9 else (1.0, 0.0, 0.0), away)
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(away, right), away])
    to_clip = np.eye(4)
    to_clip[:3, :3] = rotation / _SHADOW_HALF_M
    to_clip[2] *= -1.0
    to_clip[:3, 3] = -to_clip[:3, :3] @ _SHADOW_CENTRE
    halved = np.diag([0.5, 0.5, 0.5, 1.0])
    halved[:3, 3] = 0.5
    return to_clip, halved @ to_clip


def _bytes(matrix):
    """A (4, 4) matrix column by column, as OpenGL reads it."""
    return np.asarray(matrix, dtype=np.float32).T.tobytes()
