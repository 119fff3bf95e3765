#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The response to a large or hostile description names the limit that it exceeds, and the world goes on meanwhile."""
import os
import random
import shutil
import tempfile
import threading
import unittest

import rospy
import rostest
from gazebo_msgs import srv
from geometry_msgs.msg import Point, Pose, Quaternion
from nav_msgs.msg import Odometry

from lab_testing.hostile_descriptions import chain, write_ball, write_entity_bomb
from lab_testing.waiting import wait_until

BODY = """<robot name="m"><link name="l"><inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>
  <collision><geometry>%s</geometry></collision></link></robot>"""
MESH = BODY % '<mesh filename="%s"/>'
POSE_TOPIC = """<gazebo><plugin name="p" filename="libgazebo_ros_p3d.so"><bodyName>l</bodyName>
  <topicName>place</topicName></plugin></gazebo></robot>"""
BOX = BODY % '<box size="0.2 0.2 0.2"/>'
DEADLINE_S = 60.0
# As many ticks as pass while a large mesh is read, on any machine: reading it takes seconds, a tick 2 ms.
TICKS = 20


class GazeboHostile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for name, srv_class in (("spawn_urdf_model", srv.SpawnModel), ("delete_model", srv.DeleteModel),
                                ("get_world_properties", srv.GetWorldProperties),
                                ("get_model_state", srv.GetModelState)):
            proxy = rospy.ServiceProxy("/gazebo/" + name, srv_class)
            proxy.wait_for_service(DEADLINE_S)
            setattr(cls, name, staticmethod(proxy))
        cls.folder = tempfile.mkdtemp()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def tearDown(self):
        self.delete_model("m")

    def path(self, name):
        return os.path.join(self.folder, name)

    def spawn(self, xml, namespace=""):
        return self.spawn_urdf_model("m", xml, namespace, Pose(Point(5, 0, 0.5), Quaternion(0, 0, 0, 1)), "")

    def sim_time(self):
        return self.get_world_properties().sim_time

    def stood_in_for(self, mesh, *words):
        response = self.spawn(MESH % mesh)
        self.assertTrue(response.success, response.status_message)
        for word in ("replaces it", *words):
            self.assertIn(word, response.status_message)

    def test_meshes_that_are_no_files(self):
        os.mkfifo(self.path("pipe.stl"))
        self.stood_in_for(self.path("pipe.stl"), "a named pipe, not a file")
        self.delete_model("m")
        self.stood_in_for("/dev/zero", "a device, not a file")
        self.delete_model("m")
        self.stood_in_for("http://10.255.255.1/a.stl", "not fetched over the network")

    def test_meshes_that_lie(self):
        write_entity_bomb(self.path("bomb.dae"))
        self.stood_in_for(self.path("bomb.dae"), "bomb.dae cannot be used")
        self.delete_model("m")
        write_ball(self.path("lie.stl"), 5, announced=2**32 - 1)
        self.stood_in_for(self.path("lie.stl"), "lie.stl cannot be used")

    def test_descriptions_without_end(self):
        for xml, word in ((chain(100_000), "expected at most 4000000"), (chain(3_000), "expected at most 2000"),
                          ("<robot name='m'>%s</robot>" % ("<a>" * 300), "not well-formed")):
            response = self.spawn(xml)
            self.assertFalse(response.success)
            self.assertIn(word, response.status_message)

    def test_a_namespace_that_is_none_keeps_no_later_model_from_its_topics(self):
        for namespace in ("a\x01b", "a b"):
            response = self.spawn(BODY.replace("</robot>", POSE_TOPIC) % "<box size='1 1 1'/>", namespace)
            self.assertFalse(response.success)
            self.assertIn(ascii(namespace)[1:-1], response.status_message)
        self.assertTrue(self.spawn(BODY.replace("</robot>", POSE_TOPIC) % "<box size='1 1 1'/>", "/ok").success)
        rospy.wait_for_message("/ok/place", Odometry, DEADLINE_S)

    def test_the_world_goes_on_while_a_large_mesh_is_read(self):
        write_ball(self.path("large.stl"), 548, radius=random.uniform(0.5, 1.5))  # 600,608 triangles, in no cache
        answers = []
        before = self.sim_time()
        thread = threading.Thread(target=lambda: answers.append(self.spawn(MESH % self.path("large.stl"))), daemon=True)
        thread.start()
        wait_until(lambda: answers or self.sim_time() > before + 0.002 * TICKS, "ticks", DEADLINE_S)
        self.assertEqual(answers, [], "the answer came before %d ticks had passed" % TICKS)
        thread.join(DEADLINE_S)
        # On a slow processor it exceeds the time limit, and a sphere replaces it.
        self.assertTrue(answers and answers[0].success, answers)

    def test_afterwards_all_is_as_before(self):
        self.assertTrue(self.spawn(BOX).success)
        wait_until(lambda: abs(self.get_model_state("m", "").pose.position.z - 0.1) < 0.005, "the box on the floor")


if __name__ == "__main__":
    rospy.init_node("gazebo_hostile_test")
    rostest.rosrun("gazebo_ros", "gazebo_hostile", GazeboHostile)
