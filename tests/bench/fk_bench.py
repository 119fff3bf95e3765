# SPDX-License-Identifier: BSD-3-Clause
"""Forward kinematics and Jacobian, one call from Python: ours compared with PyKDL and PyBullet."""
import re
import tempfile
import time

import numpy as np
import pybullet
import PyKDL
from arms import arms, fill, kdl_chain

CALLS = 4000


def mean_us(function, postures):
    """Mean time of ``function(q)`` [us] over the postures."""
    function(postures[0])
    start = time.perf_counter()
    for q in postures:
        function(q)
    return 1e6 * (time.perf_counter() - start) / len(postures)


def measure(report, quick, number):
    for k, arm in enumerate(arms()):
        if arm.name == "right arm":
            continue
        chain = arm.chain
        rng = np.random.default_rng((number, k))
        postures = rng.uniform(chain.lower, chain.upper, (CALLS // 10 if quick else CALLS, len(chain)))
        ours_fk, ours_jacobian = mean_us(chain.fk, postures), mean_us(chain.jacobian, postures)
        for name, fk, jacobian in (("PyKDL", *with_kdl(arm)), ("PyBullet", *with_bullet(arm))):
            check(arm, postures[:20], name, fk)
            report.add("%s: forward kinematics, beside %s" % (arm.name, name), ours_fk, "us",
                       (name, mean_us(fk, postures)))
            report.add("%s: Jacobian, beside %s" % (arm.name, name), ours_jacobian, "us",
                       (name, mean_us(jacobian, postures)))


def check(arm, postures, name, fk):
    """Check that the peer computes the same point; the comparison is invalid otherwise."""
    for q in postures:
        if np.linalg.norm(fk(q) - arm.chain.fk(q)[:3, 3]) > 1e-5:
            raise SystemExit("%s puts the tip of the %s elsewhere" % (name, arm.name))


def with_kdl(arm):
    model = kdl_chain(arm)
    position, jacobian = PyKDL.ChainFkSolverPos_recursive(model), PyKDL.ChainJntToJacSolver(model)
    values, frame, matrix = PyKDL.JntArray(len(arm.chain)), PyKDL.Frame(), PyKDL.Jacobian(len(arm.chain))

    def fk(q, _alive=model):  # the solvers refer to the chain without holding it
        fill(values, q.tolist())
        position.JntToCart(values, frame)
        return np.array([frame.p[0], frame.p[1], frame.p[2]])

    def whole_jacobian(q, _alive=model):
        fill(values, q.tolist())
        jacobian.JntToJac(values, matrix)
        return matrix

    return fk, whole_jacobian


def bare(urdf):
    """A URDF without shapes, which needs no meshes, and without elements that PyBullet's reader cannot read."""
    for element in (r"<!--.*?-->", r"<(visual|collision|gazebo|transmission)\b.*?</\1>"):
        urdf = re.sub(element, "", urdf, flags=re.DOTALL)
    return urdf.replace(">", ">\n")


def with_bullet(arm):
    """The fewest calls of PyBullet that take joint angles and return the body's pose or the Jacobian."""
    client = pybullet.connect(pybullet.DIRECT)
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(bare(arm.urdf))
        file.flush()
        body = pybullet.loadURDF(file.name, useFixedBase=True, physicsClientId=client)
    info = [pybullet.getJointInfo(body, i, physicsClientId=client)
            for i in range(pybullet.getNumJoints(body, physicsClientId=client))]
    moving = [i for i, joint in enumerate(info) if joint[2] != pybullet.JOINT_FIXED]
    number = {joint[1].decode(): i for i, joint in enumerate(info)}
    tip = next(i for i, joint in enumerate(info) if joint[12].decode() == arm.chain.tip)
    joints = [number[name] for name in arm.chain.joint_names]
    columns = [moving.index(joint) for joint in joints]
    still, everything, zeros = [[0.0]] * len(joints), np.zeros(len(moving)), [0.0] * len(moving)
    # PyBullet's origin is the root's centre of mass, which may differ from the chain's base.
    root = {joint.child: joint for joint in arm.robot.joints.values()}
    offset = np.zeros(3) if arm.chain.base not in root else root[arm.chain.base].origin[:3, 3]
    inertial = arm.robot.links[arm.robot.root].inertial
    offset = offset - (inertial.centre if inertial is not None else 0.0)

    def fk(q):
        pybullet.resetJointStatesMultiDof(body, joints, q[:, None].tolist(), still, physicsClientId=client)
        return pybullet.getLinkState(body, tip, computeForwardKinematics=True, physicsClientId=client)[4] - offset

    def jacobian(q):
        everything[columns] = q
        return pybullet.calculateJacobian(body, tip, [0.0, 0.0, 0.0], everything.tolist(), zeros, zeros,
                                          physicsClientId=client)

    return fk, jacobian
