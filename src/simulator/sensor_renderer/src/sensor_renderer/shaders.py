# SPDX-License-Identifier: BSD-3-Clause
"""The shaders' texts. ROS-free.

Without a graphics card, vertices cost more than pixels: light is computed per pixel, and a pixel behind others is not
shaded. Even an empty loop over lamps costs as much as the rest of a picture: lamps are written out, one by one, and
what a world does not have is not in its shaders.
"""
from __future__ import annotations

from collections.abc import Sequence

_HEAD = "#version 330\n"

_UNIFORMS = """
uniform vec3 ambient;
uniform vec3 sun;
uniform vec3 sun_shine;
uniform vec3 to_sun;
uniform vec3 eye;
uniform sampler2DShadow lamp_shadow;
uniform float margin;
vec3 n, to_eye, there, lit, glint;

// Share of the light that reaches a place in the map: comparisons, each of them between its four nearest texels.
float reached(sampler2DShadow map, vec3 at) {
    REACHED
}

// Blinn's highlight ("Models of light reflection for computer synthesized pictures", 1977).
void light_from(vec3 l, vec3 diffuse, vec3 shine, float part) {
    float facing = max(dot(n, l), 0.0) * part;
    lit += diffuse * facing;
    glint += shine * (facing > 0.0 ? part * pow(max(dot(n, normalize(l + to_eye)), 0.0), 40.0) : 0.0);
}

// Ambient light comes from the sky and, weaker, from the floor; near the floor, less reaches what looks down.
void begin_light(vec3 outward, vec3 paint) {
    to_eye = eye - there;
    // Thinned meshes are not closed everywhere: both sides of a triangle are outside.
    n = normalize(dot(outward, to_eye) < 0.0 ? -outward : outward);
    to_eye = normalize(to_eye);
    float close = exp2(-6.0 * abs(there.z));
    lit = ambient * ((1.1 + 0.3 * n.z) * (1.0 - (0.25 - 0.25 * n.z) * close));
    // What is glossy mirrors the sky and, weaker, the floor, most where it is seen from the side: Schlick, "An
    // inexpensive BRDF model for physically-based rendering", 1994. Only where hardly anything else is seen, on black
    // paint and plastic: other colours stay what their materials say.
    float dark = 1.0 - max(paint.r, max(paint.g, paint.b));
    float ahead = dot(n, to_eye), aside = (1.0 - ahead) * (1.0 - ahead);
    glint = ambient * (dark > 0.0 ? dark * dark * dark * dark * (1.6 + 0.8 * (2.0 * ahead * n.z - to_eye.z))
                                    * (0.3 + 0.7 * aside * aside) : 0.0);
}

// Hue stays: all three colours are dimmed by the same factor, so that the brightest of them bends towards white.
vec3 toned(vec3 light) {
    float most = max(light.r, max(light.g, light.b));
    return most > 0.8 ? light * ((1.0 - 0.04 / (most - 0.6)) / most) : light;
}
"""

_REACHED_ONE = "return textureLod(map, at, 0.0);"

_REACHED_SOME = """vec2 texel = 1.0 / vec2(textureSize(map, 0));
    float sum = 0.0;
    for (int i = 0; i < TAPS; ++i)
        for (int j = 0; j < TAPS; ++j)
            sum += textureLod(map, at + vec3((vec2(i, j) - 0.5 * float(TAPS - 1)) * texel, 0.0), 0.0);
    return sum / float(TAPS * TAPS);"""

_LAMP_UNIFORMS = """
uniform vec4 lamp_place_K;
uniform vec3 lamp_colour_K;
uniform vec3 lamp_shine_K;
uniform vec4 lamp_fade_K;
uniform vec3 lamp_beam_K;
uniform vec3 lamp_cone_K;
uniform vec4 lamp_depth_K;
uniform mat4 lamp_matrix_K;
"""

_PARALLEL = """
    light_from(lamp_place_K.xyz, lamp_colour_K, lamp_shine_K, 1.0);
"""

_POINT = """
    {
        vec3 ray = lamp_place_K.xyz - there;
        float away = max(length(ray), 1e-6);
        vec3 l = ray / away;
        float part = 1.0 / max(lamp_fade_K.x + away * (lamp_fade_K.y + away * lamp_fade_K.z), 1e-6);
        if (away > lamp_fade_K.w || dot(n, l) <= 0.0) part = 0.0;
        SPOT
        SHADOW
        light_from(l, lamp_colour_K, lamp_shine_K, part);
    }
"""

_SPOT = """
        part *= pow(clamp((dot(-l, lamp_beam_K) - lamp_cone_K.y) / (lamp_cone_K.x - lamp_cone_K.y), 0.0, 1.0),
                    lamp_cone_K.z);
"""

# A spot light has one map, along its beam.
_SPOT_SHADOW = """
        if (part > 0.0) {
            vec4 at = lamp_matrix_K * vec4(there + (margin + 0.01 * away) * n, 1.0);
            part *= reached(lamp_shadow, at.xyz / at.w);
        }
"""

# A point light has six maps, the sides of a cube, side by side in a row of the texture.
_POINT_SHADOW = """
        if (part > 0.0) {
            vec3 d = there + (margin + 0.01 * away) * n - lamp_place_K.xyz;
            vec3 a = abs(d);
            float m = max(a.x, max(a.y, a.z));
            bool x = a.x == m, y = !x && a.y == m;
            vec2 side = (x ? d.yz : y ? d.xz : d.xy) / m;
            float number = (x ? 0.0 : y ? 2.0 : 4.0) + ((x ? d.x : y ? d.y : d.z) > 0.0 ? 0.0 : 1.0);
            vec2 at = vec2(number + 0.5 + 0.49 * side.x, lamp_depth_K.z + 0.5 + 0.49 * side.y);
            part *= reached(lamp_shadow, vec3(at / vec2(6.0, lamp_depth_K.w), lamp_depth_K.x - lamp_depth_K.y / m));
        }
"""

# Light per vertex: of meshes, whose triangles are not much larger than pixels, and of the floor under the sun alone.
# dim is without the sun, bright what the sun adds.
_LIT_VERTEX = """
uniform mat4 body;
uniform mat4 to_clip;
uniform mat4 to_shadow;
in vec3 position;
in vec3 normal;
in vec4 colour;
out vec3 dim;
out vec3 bright;
out vec3 shadow_place;
out vec2 place;
out vec3 own;
void main() {
    vec4 placed = body * vec4(position, 1.0);
    there = placed.xyz;
    place = there.xy;
    begin_light(mat3(body) * normal, colour.rgb);
    LAMPS
    dim = colour.rgb * lit + colour.a * glint;
    lit = glint = vec3(0.0);
    light_from(to_sun, sun, sun_shine, 1.0);
    bright = colour.rgb * lit + colour.a * glint;
    TONE
    shadow_place = (to_shadow * vec4(there + margin * n, 1.0)).xyz;
    own = colour.rgb;
    gl_Position = to_clip * placed;
}
"""

_TONE_VERTEX = """
    bright = toned(dim + bright);
    dim = toned(dim);
    bright -= dim;
"""

_LIT_FRAGMENT = """
uniform sampler2DShadow shadow;
in vec3 dim;
in vec3 bright;
in vec3 shadow_place;
out vec4 seen;
void main() { seen = vec4(dim + bright * SUNLIT, 1.0); }
"""

# Tiles of half a metre, averaged over the pixel: far tiles become one grey instead of a pattern of noise. In the sky's
# light, far floor fades into the horizon.
_FLOOR_FRAGMENT = """
uniform sampler2DShadow shadow;
uniform vec3 horizon;
in vec3 dim;
in vec3 bright;
in vec3 shadow_place;
in vec2 place;
in vec3 own;
out vec4 seen;
void main() {
    vec2 tile = 2.0 * place, wide = max(fwidth(tile), 1e-4);
    vec2 even = clamp((4.0 * abs(fract(0.5 * tile + 0.25) - 0.5) - 1.0) / wide, -1.0, 1.0);
    even *= clamp(1.5 - wide, 0.0, 1.0);
    vec3 light = dim + bright * SUNLIT;
    LAMPS
    light *= 0.96 + 0.04 * even.x * even.y;
    HAZE
    seen = vec4(light, 1.0);
}
"""

_FLOOR_LAMPS = """
    there = vec3(place, 0.0);
    n = vec3(0.0, 0.0, 1.0);
    to_eye = normalize(eye - there);
    lit = glint = vec3(0.0);
    LAMPS
    light = toned(light + own * lit);
"""

_HAZE = """
    light = mix(light, horizon, clamp((1.0 / gl_FragCoord.w - 10.0) / 35.0, 0.0, 1.0));
"""

# Light per pixel: of primitives, whose triangles are large, and of everything in a still.
_PLACED_VERTEX = """
uniform mat4 body;
uniform mat4 to_clip;
in vec3 position;
in vec3 normal;
in vec4 colour;
out vec3 place;
out vec3 outward;
out vec4 own;
void main() {
    vec4 placed = body * vec4(position, 1.0);
    place = placed.xyz;
    outward = mat3(body) * normal;
    own = colour;
    gl_Position = to_clip * placed;
}
"""

_PLACED_FRAGMENT = """
uniform sampler2DShadow shadow;
uniform mat4 to_shadow;
in vec3 place;
in vec3 outward;
in vec4 own;
out vec4 seen;
void main() {
    there = place;
    begin_light(outward, own.rgb);
    vec3 shadow_place = (to_shadow * vec4(there + margin * n, 1.0)).xyz;
    light_from(to_sun, sun, sun_shine, SUNLIT);
    LAMPS
    seen = vec4(toned(own.rgb * lit + own.a * glint), 1.0);
}
"""

# The same, with a picture and with light of its own.
_TEXTURED_VERTEX = """
uniform mat4 body;
uniform mat4 to_clip;
in vec3 position;
in vec3 normal;
in vec4 colour;
in vec2 uv;
out vec3 place;
out vec3 outward;
out vec4 own;
out vec2 uv_there;
void main() {
    vec4 placed = body * vec4(position, 1.0);
    place = placed.xyz;
    outward = mat3(body) * normal;
    own = colour;
    uv_there = uv;
    gl_Position = to_clip * placed;
}
"""

_TEXTURED_FRAGMENT = """
uniform sampler2DShadow shadow;
uniform mat4 to_shadow;
uniform sampler2D picture;
uniform vec3 emission;
// Pixels that are more transparent than this are holes.
uniform float least;
uniform float opacity;
in vec3 place;
in vec3 outward;
in vec4 own;
in vec2 uv_there;
out vec4 seen;
void main() {
    vec4 texel = texture(picture, uv_there);
    if (texel.a < least) discard;
    there = place;
    begin_light(outward, vec3(1.0));
    vec3 shadow_place = (to_shadow * vec4(there + margin * n, 1.0)).xyz;
    light_from(to_sun, sun, sun_shine, SUNLIT);
    LAMPS
    // The light is toned, not the product with the picture, whose edges stay where they are: half of a white pixel and
    // half of a black one are half as bright as a white one.
    vec3 light = toned(own.rgb * lit + emission);
    seen = vec4(texel.rgb * light + toned(own.rgb * lit + emission + own.a * glint) - light, opacity);
}
"""

SHADOW_VERTEX = _HEAD + """
uniform mat4 body;
uniform mat4 to_clip;
in vec3 position;
void main() { gl_Position = to_clip * (body * vec4(position, 1.0)); }
"""

SHADOW_FRAGMENT = _HEAD + """
// The number counts only where a picture of numbers is drawn.
uniform uint number;
out uint seen;
void main() { seen = number; }
"""

SCREEN_VERTEX = _HEAD + """
uniform mat4 body;
uniform mat4 to_clip;
// Width, height, and the curvature around y; 0 for a flat one.
uniform vec3 shape;
in vec2 corner;
out vec2 place;
void main() {
    place = vec2(0.5 + corner.x, 0.5 - corner.y);
    vec3 at = vec3(corner * shape.xy, 0.0);
    if (shape.z > 0.0) at.xz = vec2(sin(at.x * shape.z), cos(at.x * shape.z)) / shape.z;
    gl_Position = to_clip * (body * vec4(at, 1.0));
}
"""

SCREEN_FRAGMENT = _HEAD + """
uniform sampler2D picture;
in vec2 place;
out vec4 seen;
// The brightness is also the opacity, which counts for lights alone.
void main() {
    vec3 light = texture(picture, place).rgb;
    seen = vec4(light, max(light.r, max(light.g, light.b)));
}
"""

# A grid over the whole picture, at the largest depth. Its colours are computed per vertex.
SKY_VERTEX = _HEAD + """
uniform mat4 from_clip;
uniform vec3 horizon;
uniform vec3 zenith;
uniform vec3 sun;
uniform vec3 to_sun;
in vec2 corner;
out vec3 air;
void main() {
    vec3 away = normalize((from_clip * vec4(corner, 1.0, 1.0)).xyz);
    air = mix(horizon, zenith, sqrt(clamp(away.z, 0.0, 1.0)));
    air = min(air + 0.12 * sun * pow(max(dot(away, to_sun), 0.0), 8.0), 1.0);
    gl_Position = vec4(corner, 1.0, 1.0);
}
"""

SKY_FRAGMENT = _HEAD + """
in vec3 air;
out vec4 seen;
void main() { seen = vec4(air, 1.0); }
"""


def lit_shaders(sun_shadow: bool, lamps: Sequence[tuple[str, bool]], taps: int) -> tuple[str, str]:
    """(vertex, fragment) shader for light per vertex. ``sun_shadow``: whether the sun casts shadows; ``lamps``: the
    ``kind`` of each :class:`sensor_renderer.light.Lamp`; ``taps``: comparisons along one side of a filter's square."""
    vertex = _LIT_VERTEX.replace("TONE", _TONE_VERTEX)
    return _text(vertex, sun_shadow, lamps, taps), _text(_LIT_FRAGMENT, sun_shadow, (), taps)


def placed_shaders(sun_shadow: bool, lamps: Sequence[tuple[str, bool]], taps: int) -> tuple[str, str]:
    """(vertex, fragment) shader for light per pixel, as :func:`lit_shaders`."""
    return _HEAD + _PLACED_VERTEX, _text(_PLACED_FRAGMENT, sun_shadow, lamps, taps)


def textured_shaders(sun_shadow: bool, lamps: Sequence[tuple[str, bool]], taps: int) -> tuple[str, str]:
    """(vertex, fragment) shader for light per pixel on what has a picture or light of its own, as
    :func:`lit_shaders`."""
    return _HEAD + _TEXTURED_VERTEX, _text(_TEXTURED_FRAGMENT, sun_shadow, lamps, taps)


def floor_shaders(sun_shadow: bool, lamps: Sequence[tuple[str, bool]], taps: int, haze: bool) -> tuple[str, str]:
    """(vertex, fragment) shader of the floor, as :func:`lit_shaders`. ``haze``: whether it fades into the horizon. Its
    corners are far apart: lamps light it per pixel."""
    fragment = _FLOOR_FRAGMENT.replace("LAMPS", _FLOOR_LAMPS if lamps else "").replace("HAZE", _HAZE if haze else "")
    vertex = _LIT_VERTEX.replace("TONE", "" if lamps else _TONE_VERTEX)
    return _text(vertex, sun_shadow, (), taps), _text(fragment, sun_shadow, lamps, taps)


def _text(main, sun_shadow, lamps, taps):
    uniforms = "".join(_LAMP_UNIFORMS.replace("_K", "_%d" % number) for number in range(len(lamps)))
    calls = "".join(_lamp(*kind).replace("_K", "_%d" % number) for number, kind in enumerate(lamps))
    common = _UNIFORMS.replace("REACHED", _REACHED_ONE if taps == 1 else _REACHED_SOME)
    text = _HEAD + common + uniforms + main.replace("LAMPS", calls)
    return text.replace("SUNLIT", "reached(shadow, shadow_place)" if sun_shadow else "1.0").replace("TAPS", str(taps))


def _lamp(kind, shadow):
    if kind == "directional":
        return _PARALLEL
    spot = kind == "spot"
    map_read = (_SPOT_SHADOW if spot else _POINT_SHADOW) if shadow else ""
    return _POINT.replace("SPOT", _SPOT if spot else "").replace("SHADOW", map_read)
