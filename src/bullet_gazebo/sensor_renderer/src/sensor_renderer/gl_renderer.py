# SPDX-License-Identifier: BSD-3-Clause
"""Pictures with OpenGL on EGL: no display needed, a graphics card used where there is one. ROS-free.

Everything here belongs to the thread that made the renderer.
"""
import os

import numpy as np

from sensor_renderer.errors import RenderingError

# Direction that sunlight comes from where the world names no light: high, a little from the front left.
_TO_SUN = np.array([0.45, 0.25, 0.86])
_SKY = (0.62, 0.70, 0.80)
# The shadow map covers this much around the place where robots work [m], with so many pixels a side.
_SHADOW_CENTRE = np.array([0.3, 0.0, 0.7])
_SHADOW_HALF_M = 2.2
_SHADOW_PIXELS = 1024

_VERTEX = """
#version 330
uniform mat4 body;
uniform mat4 to_clip;
uniform mat4 to_shadow;
in vec3 position;
in vec3 normal;
out vec3 place;
out vec3 facing;
out vec3 shadow_place;
void main() {
    vec4 there = body * vec4(position, 1.0);
    place = there.xyz;
    facing = mat3(body) * normal;
    shadow_place = (to_shadow * there).xyz;
    gl_Position = to_clip * there;
}
"""

_FRAGMENT = """
#version 330
uniform vec3 colour;
uniform vec3 eye;
uniform vec3 to_sun;
uniform bool is_floor;
uniform sampler2DShadow shadow;
in vec3 place;
in vec3 facing;
in vec3 shadow_place;
out vec4 seen;
void main() {
    vec3 view = normalize(eye - place);
    vec3 n = normalize(facing);
    // Thinned meshes are not closed everywhere: both sides of a triangle are outside.
    n = dot(n, view) < 0.0 ? -n : n;
    float sun = max(dot(n, to_sun), 0.0);
    float lit = 0.0;
    if (sun > 0.0) {
        lit = 1.0;
        if (all(lessThan(abs(shadow_place - 0.5), vec3(0.5))))
            lit = texture(shadow, vec3(shadow_place.xy, shadow_place.z - 0.004));
    }
    vec3 base = colour;
    if (is_floor) {
        vec2 tile = floor(place.xy * 2.0);
        base *= mod(tile.x + tile.y, 2.0) < 0.5 ? 1.0 : 0.92;
    }
    float shine = lit * pow(max(dot(n, normalize(view + to_sun)), 0.0), 24.0);
    seen = vec4(base * (0.42 + 0.12 * n.z + 0.52 * sun * lit) + 0.10 * shine, 1.0);
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


class GlRenderer:
    """Draws a :class:`sensor_renderer.mirror.Mirror`."""

    def __init__(self):
        """Raises :class:`RenderingError` where there is no EGL to draw with."""
        # In software one thread: physics and the user's own programs need the other processors.
        os.environ.setdefault("LP_NUM_THREADS", "1")
        try:
            import moderngl

            self._context = moderngl.create_context(standalone=True, backend="egl", require=330)
        except Exception as error:  # noqa: BLE001  (each layer below raises its own kind)
            raise RenderingError("no OpenGL 3.3 on EGL: %s" % error) from error
        context = self._context
        self._moderngl = moderngl
        #: What draws, in the driver's own words.
        self.name = context.info["GL_RENDERER"]
        self._program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        self._shadow_program = context.program(vertex_shader=_SHADOW_VERTEX, fragment_shader=_SHADOW_FRAGMENT)
        self._shadow_map = context.depth_texture((_SHADOW_PIXELS, _SHADOW_PIXELS))
        self._shadow_map.compare_func = "<="
        self._shadow_map.repeat_x = self._shadow_map.repeat_y = False
        self._shadow_buffer = context.framebuffer(depth_attachment=self._shadow_map)
        self._arrays = {}
        self._buffers = {}
        self._shadow_of = None
        self._shadow_matrix, self._to_shadow = _shadow_matrices(_TO_SUN)
        self._program["to_sun"].value = tuple(_TO_SUN / np.linalg.norm(_TO_SUN))
        self._program["to_shadow"].write(_bytes(self._to_shadow))
        context.enable(moderngl.DEPTH_TEST)

    def render(self, mirror, pinhole, pose, colour=True, depth=False):
        """What a camera sees whose optical frame stands at ``pose`` (4, 4) in the world.

        Returns (picture, depth): uint8 (height, width, 3) red, green, blue, and float32 (height, width) metres along
        the optical z axis, NaN where nothing is; None for what was not asked for. Both are the caller's.
        """
        view = np.linalg.inv(pose)
        to_clip = pinhole.clip_matrix() @ view
        seen = _visible(mirror, pinhole, view)
        buffer, depth_texture = self._framebuffer(pinhole.width, pinhole.height)
        picture = distance = None
        if colour:
            self._draw_shadows(mirror)
            buffer.use()
            buffer.clear(*_SKY, 1.0, depth=1.0)
            program = self._program
            self._shadow_map.use(0)
            program["to_clip"].write(_bytes(to_clip))
            program["eye"].value = tuple(pose[:3, 3])
            self._draw(program, seen, 0, with_colour=True)
            picture = np.frombuffer(buffer.read(components=3, alignment=1), np.uint8)
            picture = picture.reshape(pinhole.height, pinhole.width, 3)
        else:
            buffer.use()
            buffer.clear(depth=1.0)
            self._shadow_program["to_clip"].write(_bytes(to_clip))
            self._draw(self._shadow_program, seen, 1)
        if depth:
            raw = np.frombuffer(depth_texture.read(alignment=1), np.float32)
            distance = pinhole.depth_from_buffer(raw.reshape(pinhole.height, pinhole.width))
        return picture, distance

    def close(self):
        """Give the context back."""
        self._context.release()

    def _draw_shadows(self, mirror):
        if self._shadow_of == (id(mirror), mirror.version):
            return
        self._shadow_of = (id(mirror), mirror.version)
        self._shadow_buffer.use()
        self._shadow_buffer.clear(depth=1.0)
        self._shadow_program["to_clip"].write(_bytes(self._shadow_matrix))
        casting = [(part, matrix) for part, matrix in _everything(mirror) if not part.is_floor]
        self._draw(self._shadow_program, casting, 1)

    def _draw(self, program, parts, which, with_colour=False):
        body = program["body"]
        last = None
        for part, matrix in parts:
            if matrix is not last:
                body.write(_bytes(matrix))
                last = matrix
            if with_colour:
                program["colour"].value = part.colour[:3]
                program["is_floor"].value = part.is_floor
            self._vertex_arrays(part)[which].render()

    def _vertex_arrays(self, part):
        found = self._arrays.get(part.key)
        if found is None:
            found = self._arrays[part.key] = (
                self._vertex_array(self._program, part.triangles, "3f 3f", "position", "normal"),
                self._vertex_array(self._shadow_program, part.triangles[:, :3], "3f", "position"))
        return found

    def _vertex_array(self, program, rows, layout, *names):
        """Rows that triangles share are worked on once."""
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


def _everything(mirror):
    for body in mirror.bodies.values():
        for parts, matrix in zip(body.parts, list(body.matrices), strict=True):
            for part in parts:
                yield part, matrix


def _visible(mirror, pinhole, view):
    """The parts whose spheres reach into the camera's pyramid, with their bodies' matrices."""
    # Outward normals of the four sides, in the optical frame; all go through the eye.
    left, right = -(pinhole.cx + 0.5) / pinhole.fx, (pinhole.width - 0.5 - pinhole.cx) / pinhole.fx
    top, bottom = -(pinhole.cy + 0.5) / pinhole.fy, (pinhole.height - 0.5 - pinhole.cy) / pinhole.fy
    sides = np.array([(-1.0, 0.0, left), (1.0, 0.0, -right), (0.0, -1.0, top), (0.0, 1.0, -bottom)])
    sides /= np.linalg.norm(sides, axis=1)[:, None]
    listed = list(_everything(mirror))
    if not listed:
        return []
    matrices = np.array([matrix for _, matrix in listed])
    centres = np.array([part.centre for part, _ in listed])
    radii = np.array([part.radius for part, _ in listed])
    world = np.einsum("nij,nj->ni", matrices[:, :3, :3], centres) + matrices[:, :3, 3]
    local = world @ view[:3, :3].T + view[:3, 3]
    inside = (local @ sides.T < radii[:, None]).all(axis=1)
    inside &= (local[:, 2] > pinhole.near - radii) & (local[:, 2] < pinhole.far + radii)
    return [entry for entry, wanted in zip(listed, inside.tolist(), strict=True) if wanted]


def _shadow_matrices(to_sun):
    """From the world to the clip space of the light, and to places 0 to 1 in its picture."""
    away = to_sun / np.linalg.norm(to_sun)
    right = np.cross((0.0, 1.0, 0.0), away)
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
