# SPDX-License-Identifier: BSD-3-Clause
"""The control logic without ROS does what the plugin does, bit for bit."""
import numpy as np
import pytest
from baxter_core_msgs.msg import EndEffectorCommand, HeadPanCommand

from baxter_model import poses
from baxter_sim_hardware.arms.joint_command import Mode
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.plugin import BaxterPlugin
from baxter_sim_hardware.robot_state import Event
from baxter_sim_hardware.simulated import SimulatedBaxter, Which
from bullet_sim import Pose, World
from bullet_sim.solids import with_solids

HEARD = ()
TICK_S = 0.002


def without_ros(robot, names, effects):
    world = World(time_step_s=TICK_S)
    options = BaxterPlugin.spawn_options(robot, None)
    model = world.spawn(with_solids(robot, options.pop("solids")), "baxter", Pose((0.0, 0.0, 0.93)), **options)
    angles = [poses().angles("neutral", name.split("_")[0])[name] for name in names]
    index = model.index(names)
    model.set_joint_positions(index, np.clip(angles, model.lower[index], model.upper[index]))
    return SimulatedBaxter(world, model, robot, Which(effects=effects))


def tick(simulated, times=1):
    for _ in range(times):
        time_s = simulated.world.time_s
        simulated.measure(time_s, time_s)
        simulated.update()
        simulated.world.step()


@pytest.mark.parametrize("effects", ["none", "lag,safety"])
def test_a_program_without_ros_moves_the_robot_as_the_plugin_does(make_lab, effects):
    lab = make_lab(parameters={"effects": effects})
    simulated = without_ros(lab.context.robot, [lab.model.joint_names[i] for i in lab.arm], effects)
    lab.enable()
    simulated.apply(Event.ENABLE)
    tick(simulated)
    for mode, value in ((Mode.POSITION, 0.1), (Mode.VELOCITY, 0.3), (Mode.TORQUE, 2.0), (Mode.RAW_POSITION, 0.2)):
        names = simulated.chains["left"].joint_names
        lab.command(mode, [value] * 7, names)
        lab.send("end_effector/right_gripper/command", EndEffectorCommand(command="go", args='{"position": 20}'))
        lab.send("head/command_head_pan", HeadPanCommand(value, 1.0, 1))
        simulated.measure_now()
        simulated.baxter.command("left", mode, names, [value] * 7)
        simulated.hands["right"].gripper.take("go", '{"position": 20}', "", 0, True)
        simulated.head.head.command_pan(value, 1.0, True)
        lab.run(0.1)
        tick(simulated, 50)
        assert np.array_equal(np.array(lab.model.read_joints()), np.array(simulated.model.read_joints())), mode


def test_a_disabled_robot_refuses_and_holds(make_lab):
    lab = make_lab()
    simulated = without_ros(lab.context.robot, [lab.model.joint_names[i] for i in lab.arm], "none")
    tick(simulated)
    before = simulated.model.read_joints()[0]
    with pytest.raises(CommandRefused):
        simulated.baxter.command("left", Mode.POSITION, simulated.chains["left"].joint_names, [0.0] * 7)
    tick(simulated, 50)
    assert np.abs(simulated.model.read_joints()[0] - before).max() < 1e-3
