#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Film Baxter as it waves, for the README, in the lab that runs (baxter_gazebo baxter_world.launch):

./baxter.sh sim docs/pictures/film_wave.py docs/pictures/wave.webp
"""
import subprocess
import sys

import rospy
from PIL import Image
from sensor_msgs.msg import JointState
from std_srvs.srv import Empty

from lab_display import show

FRAMES_PER_S = 8
LASTS_S = 7.5  # [simulated s]
MOVES_RAD_S = 0.1
SIZE, FINER = 400, 2  # [pixels]; drawn so many times larger, so that edges are smooth
EYE, TARGET = (2.9, 1.35, 1.75), (0.2, -0.03, 1.0)  # [m, in the world]
QUALITY = 35


def moves() -> bool:
    return max(map(abs, rospy.wait_for_message("/robot/joint_states", JointState).velocity)) > MOVES_RAD_S


def main(path: str) -> None:
    rospy.init_node("film_wave")
    program = subprocess.Popen(["rosrun", "rf_lab2", "wave.py"])
    while program.poll() is None and not moves():
        pass
    frames, rate, end = [], rospy.Rate(FRAMES_PER_S), rospy.get_time() + LASTS_S
    # The robot stands still while it is drawn: so a slow machine films as many frames as a fast one.
    pause, go_on = (rospy.ServiceProxy("/gazebo/%s_physics" % what, Empty) for what in ("pause", "unpause"))
    while program.poll() is None and rospy.get_time() < end:
        pause()
        try:
            picture = show.picture(eye=EYE, target=TARGET, size=(FINER * SIZE, FINER * SIZE))
        finally:
            go_on()
        frames.append(Image.fromarray(picture.array()).reduce(FINER))
        rate.sleep()
    program.wait()
    # There and back again: so the film has no jump.
    frames += frames[-2:0:-1]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=1000 // FRAMES_PER_S, loop=0,
                   quality=QUALITY, method=6, minimize_size=True)


if __name__ == "__main__":
    main(sys.argv[1])
