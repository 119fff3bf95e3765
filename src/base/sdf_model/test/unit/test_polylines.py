# SPDX-License-Identifier: BSD-3-Clause
"""Bodies over closed lines: volume, holes, and what bounds nothing."""
import math

import numpy as np
import pytest

from sdf_model import SdfError, parse_sdf_model
from sdf_model.polylines import extruded, polyline_file
from urdf_model import Mesh

SQUARE = [(0, 0), (4, 0), (4, 4), (0, 4)]
HOLE = [(1, 1), (1, 2), (2, 2), (2, 1)]
OTHER_HOLE = [(3, 3), (3.5, 3), (3.5, 3.5), (3, 3.5)]
# That of Gazebo's polyline.world: a square without one of its quarters.
ARROW = [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0, 0), (0.5, -0.5)]
STAR = [((2 if k % 2 else 1) * math.cos(k * math.pi / 7), (2 if k % 2 else 1) * math.sin(k * math.pi / 7))
        for k in range(14)]


def volume(lines, height):
    """The volume of the mesh by the divergence theorem; each edge belongs to two triangles, one in each direction."""
    points, faces = extruded([np.array(line, dtype=float) for line in lines], height)
    edges = [(face[i], face[(i + 1) % 3]) for face in faces.tolist() for i in range(3)]
    assert sorted(edges) == sorted((b, a) for a, b in edges), "closed"
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum()) / 6.0


@pytest.mark.parametrize(("lines", "area"), [
    ([SQUARE], 16.0), ([SQUARE[::-1]], 16.0), ([ARROW], 0.75), ([STAR], 14 * math.sin(math.pi / 7)),
    ([SQUARE, HOLE], 15.0), ([HOLE, SQUARE, OTHER_HOLE], 14.75),
    ([SQUARE, HOLE, [(1.2, 1.2), (1.8, 1.2), (1.8, 1.8)]], 15.18), ([SQUARE, [(9, 0), (10, 0), (10, 1)]], 16.5)])
def test_a_body_has_the_volume_of_its_base_times_its_height(lines, area):
    assert volume(lines, 1.5) == pytest.approx(1.5 * area)


@pytest.mark.parametrize(("line", "said"), [
    ([(0, 0), (1, 0)], "bounds no area"), ([(0, 0), (1, 0), (2, 0)], "bounds no area"),
    ([(0, 0), (2, 2), (2, 0), (0, 1.5)], "cross"), ([(k % 7, k) for k in range(3000)], "more than")])
def test_lines_that_bound_nothing_are_refused(line, said):
    with pytest.raises(ValueError, match=said):
        polyline_file([line], 1.0)


MODEL = """<sdf version="1.5"><model name="m"><link name="l">
<%(kind)s name="c"><geometry>%(lines)s</geometry></%(kind)s></link></model></sdf>"""


def lines_of(*lines, height="<height>2</height>"):
    return "".join("<polyline>%s%s</polyline>" % ("".join("<point>%g %g</point>" % point for point in line), height)
                   for line in lines)


@pytest.mark.parametrize("kind", ["collision", "visual"])
def test_polylines_of_an_sdf_are_a_mesh(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    found = parse_sdf_model(MODEL % {"kind": kind, "lines": lines_of(SQUARE, HOLE)}, "m.sdf")
    link = found.robot.links["l"]
    shape, = link.collisions + link.visuals
    assert isinstance(shape.geometry, Mesh) and found.warning == ""
    heights = [float(line.split()[3]) for line in open(shape.geometry.filename) if line.startswith("v")]
    assert set(heights) == {0.0, 2.0}
    again = parse_sdf_model(MODEL % {"kind": kind, "lines": lines_of(SQUARE, HOLE)}, "m.sdf").robot.links["l"]
    assert (again.collisions + again.visuals)[0].geometry == shape.geometry


def test_a_cache_that_cannot_be_written_is_replaced(tmp_path, monkeypatch):
    blocked = tmp_path / "cache"
    blocked.write_text("a file, not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    assert open(polyline_file([SQUARE], 1.0)).read().startswith("v ")


@pytest.mark.parametrize(("lines", "said"), [
    (lines_of(SQUARE[:2]), "<polyline>"), (lines_of(SQUARE, height="<height>-1</height>"), "<height>"),
    ("<polyline><point>1</point><height>1</height></polyline>", "<point>")])
def test_an_sdf_with_a_polyline_that_is_none_says_so(lines, said):
    with pytest.raises(SdfError, match=said):
        parse_sdf_model(MODEL % {"kind": "collision", "lines": lines}, "m.sdf")
