# SPDX-License-Identifier: BSD-3-Clause
import math

import pytest
from visualization_msgs.msg import (
    InteractiveMarker,
    InteractiveMarkerInit,
    InteractiveMarkerPose,
    InteractiveMarkerUpdate,
)

from interactive_marker_proxy.mirror import MarkerMirror, moved

STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def marker(name, x=0.0):
    made = InteractiveMarker(name=name)
    made.pose.position.x = x
    return made


def shown(mirror):
    return {one.name: one.pose.position.x for one in mirror.fill(InteractiveMarkerInit()).markers}


def test_a_page_that_comes_later_sees_all_changes():
    mirror = MarkerMirror()
    mirror.begin(InteractiveMarkerInit("server", 3, [marker("a"), marker("b")]))
    pose = InteractiveMarkerPose(name="a")
    pose.pose.position.x, pose.header.frame_id = 2.0, "hand"
    mirror.update(InteractiveMarkerUpdate(server_id="server", seq_num=4, markers=[marker("c", 1.0)], erases=["b", "x"],
                                          poses=[pose, InteractiveMarkerPose(name="nobody")]))
    assert shown(mirror) == {"a": 2.0, "c": 1.0}
    init = mirror.fill(InteractiveMarkerInit())
    assert (init.server_id, init.seq_num, init.markers[0].header.frame_id) == ("server", 4, "hand")


def test_a_server_that_restarts_replaces_its_markers():
    mirror = MarkerMirror()
    for names in ("ab", "c"):
        mirror.begin(InteractiveMarkerInit("server", 1, [marker(name) for name in names]))
    assert shown(mirror) == {"c": 0.0}


def test_a_pose_is_expressed_in_the_parent_frame():
    quarter = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))
    position, orientation = moved((1.0, 2.0, 3.0), quarter, (1.0, 0.0, 0.5), quarter)
    assert position == pytest.approx((1.0, 3.0, 3.5)) and orientation == pytest.approx((0.0, 0.0, 1.0, 0.0))
    assert moved((0.0, 0.0, 0.0), STRAIGHT, (1.0, 2.0, 3.0), quarter) == (pytest.approx((1.0, 2.0, 3.0)), quarter)
    # A third of a turn around the diagonal takes x to y, y to z and z to x.
    assert moved((0.0, 0.0, 0.0), (0.5,) * 4, (1.0, 2.0, 3.0), STRAIGHT)[0] == pytest.approx((3.0, 1.0, 2.0))


def test_what_a_page_was_sent_does_not_change_with_the_markers():
    mirror = MarkerMirror()
    mirror.begin(InteractiveMarkerInit("server", 1, [marker("a")]))
    sent = mirror.fill(InteractiveMarkerInit())
    pose = InteractiveMarkerPose(name="a")
    pose.pose.position.x = 2.0
    mirror.update(InteractiveMarkerUpdate(server_id="server", seq_num=2, poses=[pose]))
    assert sent.markers[0].pose.position.x == 0.0 and shown(mirror) == {"a": 2.0}
