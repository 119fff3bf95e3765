#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Spawned and deleted a thousand times under one name, through the services: exact poses, and the node stays small."""
import os
import tempfile
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import rostest
from gazebo_msgs.srv import DeleteModel, GetModelState, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion

TIMES = 1000
LEAK_BYTES = 20e6
URDF = """<robot name="thing"><link name="body">
  <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry>%s</geometry></visual><collision><geometry>%s</geometry></collision></link></robot>"""
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
TRIANGLES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def node_pid():
    code, text, pid = ServerProxy(rosgraph.Master("/gazebo_respawn_test").lookupNode("/gazebo")).getPid("/test")
    assert code == 1, text
    return pid


def resident_bytes(pid):
    return int(Path("/proc/%d/statm" % pid).read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def write_wedge(path, pieces=800):
    """Some thousand triangles: small tetrahedra side by side."""
    lines = ["solid wedge"]
    for piece in range(pieces):
        for triangle in TRIANGLES:
            corners = ["vertex %g %g %g" % (0.01 * CORNERS[k][0] + 0.0001 * piece, 0.1 * CORNERS[k][1],
                                            0.1 * CORNERS[k][2]) for k in triangle]
            lines.append("facet normal 0 0 0\nouter loop\n%s\nendloop\nendfacet" % "\n".join(corners))
    path.write_text("\n".join([*lines, "endsolid wedge"]), encoding="ascii")


class GazeboRespawn(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for name, srv_class in (("spawn_urdf_model", SpawnModel), ("delete_model", DeleteModel),
                                ("get_model_state", GetModelState)):
            rospy.wait_for_service("/gazebo/" + name, 30.0)
            setattr(cls, name, staticmethod(rospy.ServiceProxy("/gazebo/" + name, srv_class, persistent=True)))
        cls.pid = node_pid()

    def come_and_go(self, xml, times):
        for turn in range(times):
            # Without ground below, so that until the query it has only fallen.
            pose = Pose(Point(0.5 * turn, -3.0, 100.0), Quaternion(0, 0, 0.6, 0.8))
            spawned = self.spawn_urdf_model("again", xml, "", pose, "")
            self.assertTrue(spawned.success, spawned.status_message)
            got = self.get_model_state("again", "").pose
            self.assertAlmostEqual(got.position.x, pose.position.x, places=9)
            self.assertAlmostEqual(got.position.z, pose.position.z, delta=0.5)
            self.assertAlmostEqual(got.orientation.z, 0.6, places=9)
            deleted = self.delete_model("again")
            self.assertTrue(deleted.success, deleted.status_message)

    def check(self, label, geometry):
        xml = URDF % (geometry, geometry)
        self.come_and_go(xml, 50)
        before = resident_bytes(self.pid)
        self.come_and_go(xml, TIMES)
        grown = resident_bytes(self.pid) - before
        print("%s, %d times: %+.1f MB" % (label, TIMES, grown / 1e6))
        self.assertLess(grown, LEAK_BYTES)

    def test_a_box(self):
        self.check("box", '<box size="0.1 0.2 0.3"/>')

    def test_a_mesh(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "wedge.stl"
            write_wedge(path)
            self.check("mesh", '<mesh filename="file://%s"/>' % path)


if __name__ == "__main__":
    rospy.init_node("gazebo_respawn_test", disable_rostime=True)
    rostest.rosrun("gazebo_ros", "gazebo_respawn", GazeboRespawn)
