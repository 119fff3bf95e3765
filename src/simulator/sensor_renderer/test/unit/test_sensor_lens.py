# SPDX-License-Identifier: BSD-3-Clause
"""Cameras whose lens distorts, against OpenCV; a tag is where OpenCV finds it in a drawn picture."""
import cv2
import numpy as np
import pytest

from sensor_renderer import convert
from sensor_renderer.errors import SensorError
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.lens import Distortion, Lens
from sensor_renderer.mirror import Mirror
from sensor_renderer.pictures import Cloud
from sensor_renderer.pinhole import OPTICAL, Pinhole
from urdf_model.transforms import inverse, pose_matrix
from world_picture.drawing import DrawingCache
from world_picture.shared_picture import PictureWriter

PINHOLE = Pinhole.from_field_of_view(640, 400, 1.2, 0.05, 20.0)
BARREL, CUSHION = Distortion(-0.3, 0.1, 0.001, -0.002, -0.01), Distortion(0.15, 0.02, -0.001, 0.001, 0.0)
TAG_M, AWAY_M = 0.12, 0.8
SHEET = """<robot name="sheet"><link name="link"><visual><origin xyz="0 0 -0.01"/><geometry>
<box size="0.3 0.3 0.002"/></geometry></visual></link></robot>"""


def matrix(info):
    return np.reshape(info.K, (3, 3)), np.array(info.D)


@pytest.mark.parametrize("distortion", [BARREL, CUSHION])
def test_rays_arrive_where_opencv_says(distortion):
    rays = np.random.default_rng(1).uniform(-0.6, 0.6, (200, 2))
    arrivals = distortion.distorted(rays)
    theirs, _ = cv2.projectPoints(np.column_stack([rays, np.ones(200)]), np.zeros(3), np.zeros(3), np.eye(3),
                                  np.array(distortion))
    assert arrivals == pytest.approx(theirs.reshape(-1, 2), abs=1e-12)
    assert distortion.rays(arrivals) == pytest.approx(rays, abs=1e-8)


@pytest.mark.parametrize("distortion", [BARREL, CUSHION])
def test_each_pixel_shows_what_camera_info_says(distortion):
    """Pictures whose values are their own coordinates: each pixel tells where it comes from."""
    lens = Lens(PINHOLE, distortion)
    ideal = lens.ideal
    columns, rows = np.meshgrid(np.arange(ideal.width), np.arange(ideal.height))
    shown = lens.picture(np.dstack([columns, rows, rows]).astype(np.float32))
    v, u = np.mgrid[0:400:7, 0:640:7]
    info = convert.camera_info(PINHOLE, 0.0, distortion)
    points = np.stack([(shown[v, u, 0] - ideal.cx) / ideal.fx, (shown[v, u, 1] - ideal.cy) / ideal.fy,
                       np.ones(v.shape)], axis=-1).reshape(-1, 3)
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *matrix(info))
    assert pixels.reshape(-1, 2) == pytest.approx(np.stack([u, v], axis=-1).reshape(-1, 2), abs=0.1)
    depth = lens.nearest(columns.astype(np.float32))
    assert np.abs(depth - shown[..., 0]).max() <= 0.51


def test_points_of_a_distorted_depth_picture_lie_in_a_plane():
    lens = Lens(PINHOLE, BARREL)
    points = Cloud(PINHOLE, lens.rays).points(np.full((400, 640), 2.0, dtype=np.float32),
                                              np.zeros((400, 640, 3), dtype=np.uint8))
    pixels, _ = cv2.projectPoints(points[::50, ::50, :3].reshape(-1, 3).astype(float), np.zeros(3), np.zeros(3),
                                  *matrix(convert.camera_info(PINHOLE, 0.0, BARREL)))
    v, u = np.mgrid[0:400:50, 0:640:50]
    assert pixels.reshape(-1, 2) == pytest.approx(np.stack([u, v], axis=-1).reshape(-1, 2), abs=0.01)


@pytest.mark.parametrize(("distortion", "text"), [(Distortion(-2.0), "single ray"), (Distortion(k1=-1e9), "single ray"),
                                                  (Distortion(float("inf")), "single ray")])
def test_a_lens_that_folds_the_picture_is_refused(distortion, text):
    with pytest.raises(SensorError, match=text):
        Lens(PINHOLE, distortion)


@pytest.mark.parametrize("distortion", [None, BARREL, CUSHION])
def test_camera_info_says_within_a_tenth_of_a_pixel_where_points_are_seen(tmp_path, distortion):
    """The corners of a chessboard, as OpenCV finds them in the picture and as it projects them by K and D."""
    cell, columns, rows = 40, 9, 7
    dark = (np.indices((rows * cell, columns * cell)) // cell).sum(axis=0) % 2
    board = np.where(dark, 25, 230).astype(np.uint8)
    writer = PictureWriter(tmp_path / "board", columns * cell, rows * cell)
    writer.show(np.repeat(board[:, :, None], 3, axis=2))
    square_m = 0.06
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([{"name": "sheet", "urdf": SHEET, "joints": [], "screens": [
        {"link": "link", "offset": np.eye(4).ravel().tolist(), "size": [columns * square_m, rows * square_m],
         "picture": str(writer.path)}]}])
    mirror.set_state(np.array([0, 0, 0, 0, 0, 0, 1.0]))
    points = np.array([((x - columns / 2.0) * square_m, (rows / 2.0 - y) * square_m, 0.0)
                       for y in range(1, rows) for x in range(1, columns)])
    lens = Lens(PINHOLE, distortion) if distortion else None
    info = convert.camera_info(PINHOLE, 0.0, distortion or Distortion())
    renderer = GlRenderer()
    for slant, turn, away in ((0.05, 0.25, 0.5), (0.4, 0.3, 0.6), (-0.5, 2.0, 0.7)):
        pose = pose_matrix((0.0, 0.0, 0.0), (0.0, np.pi / 2 + slant, turn)) @ OPTICAL
        pose[:3, 3] = -away * pose[:3, 2] + 0.03 * pose[:3, 0]
        picture, _ = renderer.render(mirror, lens.ideal if lens else PINHOLE, pose)
        picture = lens.picture(picture) if lens else picture
        camera = inverse(pose)
        expected, _ = cv2.projectPoints(points, cv2.Rodrigues(camera[:3, :3])[0], camera[:3, 3], *matrix(info))
        expected = expected.reshape(-1, 2)
        inside = ((expected > 12) & (expected < (640 - 12, 400 - 12))).all(axis=1)
        assert inside.sum() > 30
        # Edges of one pixel's width would count by where they fall on the pixels.
        grey = cv2.GaussianBlur(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), (0, 0), 1.0)
        seen = cv2.cornerSubPix(grey, expected[inside].astype(np.float32).reshape(-1, 1, 2), (5, 5), (-1, -1),
                                (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4)).reshape(-1, 2)
        off = np.linalg.norm(seen - expected[inside], axis=1)
        assert off.mean() < 0.05 and off.max() < 0.1
    renderer.close()
    writer.close()


@pytest.mark.parametrize("distortion", [None, BARREL])
def test_opencv_finds_a_tag_where_it_is(tmp_path, distortion):
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    pixels = np.full((200, 200), 255, dtype=np.uint8)
    # OpenCV 4.7 has renamed it.
    draw = getattr(cv2.aruco, "generateImageMarker", None) or cv2.aruco.drawMarker
    pixels[20:180, 20:180] = draw(dictionary, 7, 160)
    writer = PictureWriter(tmp_path / "tag", 200, 200)
    writer.show(np.repeat(pixels[:, :, None], 3, axis=2))
    side = TAG_M * 200 / 160
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([{"name": "sheet", "urdf": SHEET, "joints": [], "screens": [
        {"link": "link", "offset": np.eye(4).ravel().tolist(), "size": [side, side], "picture": str(writer.path)}]}])
    mirror.set_state(np.array([0, 0, 0, 0, 0, 0, 1.0]))
    lens = Lens(PINHOLE, distortion) if distortion else None
    info = convert.camera_info(PINHOLE, 0.0, distortion or Distortion())
    renderer = GlRenderer()
    for slant, turn in ((0.3, 0.2), (-0.5, 1.0), (0.4, -2.0)):
        pose = pose_matrix((0.0, 0.0, 0.0), (0.0, np.pi / 2 + slant, turn)) @ OPTICAL
        pose[:3, 3] = -AWAY_M * pose[:3, 2] + 0.05 * pose[:3, 0]
        picture, _ = renderer.render(mirror, lens.ideal if lens else PINHOLE, pose)
        picture = lens.picture(picture) if lens else picture
        grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        corners, names = _found(grey, dictionary)
        assert names is not None and names.ravel().tolist() == [7]
        half = TAG_M / 2.0
        square = np.array([(-half, half, 0), (half, half, 0), (half, -half, 0), (-half, -half, 0)])
        _, rotation, place = cv2.solvePnP(square, corners[0][0], *matrix(info), flags=cv2.SOLVEPNP_IPPE_SQUARE)
        true = inverse(pose)
        assert np.linalg.norm(place.ravel() - true[:3, 3]) < 0.003
        difference = cv2.Rodrigues(rotation)[0].T @ true[:3, :3]
        assert np.degrees(np.arccos(min(1.0, (np.trace(difference) - 1.0) / 2.0))) < 0.5
    renderer.close()
    writer.close()


def _found(grey, dictionary):
    """(corners, numbers) of the tags, by OpenCV of before and after its detector became a class (4.7)."""
    is_class = hasattr(cv2.aruco, "ArucoDetector")
    parameters = cv2.aruco.DetectorParameters() if is_class else cv2.aruco.DetectorParameters_create()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    if is_class:
        return cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(grey)[:2]
    return cv2.aruco.detectMarkers(grey, dictionary, parameters=parameters)[:2]
