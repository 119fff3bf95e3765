# SPDX-License-Identifier: BSD-3-Clause
"""Joints read and driven through Bullet's C interface, for who does so at every tick.

PyBullet makes a tuple for each joint where three arrays are wanted, and takes lists where there are arrays. The same
functions of Bullet called from compiled code take little more than half the time and give the same bits
(docs/decisions/0007).
Importing this imports numba; ``Model.call_directly`` does so for who asks.
"""

import ctypes
import mmap
import struct

import llvmlite.binding
import numpy as np
import pybullet
from numba import types

from numba_cache import compiler

from .errors import BulletSimError

# PhysicsClientC_API.h: handles are pointers; a double is a double. b3JointSensorState holds position, velocity, six
# reaction forces and torques, and what the joint's motor applied; here with room to spare.
_SENSOR_DOUBLES, _MOTOR = 16, 8
_POSITION_CONTROL = pybullet.POSITION_CONTROL
_FUNCTIONS = {
    "b3RequestActualStateCommandInit": types.intp(types.intp, types.int32),
    "b3SubmitClientCommandAndWaitStatus": types.intp(types.intp, types.intp),
    "b3GetStatusActualState": types.int32(*[types.intp] * 8),
    "b3GetJointState": types.int32(types.intp, types.intp, types.int32, types.intp),
    "b3JointControlCommandInit2": types.intp(types.intp, types.int32, types.int32),
    "b3JointControlSetDesiredPosition": types.int32(types.intp, types.int32, types.float64),
    "b3JointControlSetDesiredVelocity": types.int32(types.intp, types.int32, types.float64),
    "b3JointControlSetKp": types.int32(types.intp, types.int32, types.float64),
    "b3JointControlSetKd": types.int32(types.intp, types.int32, types.float64),
    "b3JointControlSetMaximumForce": types.int32(types.intp, types.int32, types.float64),
}
(
    _request_state, _submit, _get_state, _get_joint_state, _control,
    _set_position, _set_velocity, _set_kp, _set_kd, _set_force,
) = (types.ExternalFunction(name, signature) for name, signature in _FUNCTIONS.items())

_compiled = compiler("bullet_sim", [__file__])

# Where ELF files (64 bits, little-endian) keep their symbols: System V ABI, chapters "Sections" and "Symbol Table".
_ELF64 = b"\x7fELF\x02\x01"
_SECTIONS_AT, _SECTION_SIZE_AT = 0x28, 0x3A
_SECTION = struct.Struct("<IIQQQQIIQQ")
_TYPE, _OFFSET, _SIZE, _LINK, _SYMBOL_TABLE = 1, 4, 5, 6, 2
_SYMBOL = np.dtype(
    [("name", "<u4"), ("info", "u1"), ("other", "u1"), ("section", "<u2"), ("value", "<u8"), ("size", "<u8")]
)
_KIND, _FUNCTION, _UNDEFINED = 0xF, 2, 0


class DirectJoints:
    """The joints of one body, as ``Model`` reads and drives them. Of no use once the body is gone."""

    def __init__(self, handle, body, indices):
        """``handle``: of :func:`client_handle`; ``indices``: (2, n) int32, where Bullet keeps a joint's position and
        its velocity."""
        self._handle, self._body, self._indices = handle, body, indices
        self._sensor = np.zeros(_SENSOR_DOUBLES)

    @classmethod
    def of(cls, client, body, count):
        """Return the DirectJoints of a body with ``count`` joints in PyBullet's physics client, or None where this
        PyBullet does not let itself be called so."""
        handle = client_handle(client)
        if handle is None:
            return None
        infos = [pybullet.getJointInfo(body, joint, physicsClientId=client) for joint in range(count)]
        direct = cls(handle, body, np.array([[info[3] for info in infos], [info[4] for info in infos]], dtype=np.int32))
        states = pybullet.getJointStates(body, list(range(count)), physicsClientId=client)
        told = np.array([(position, velocity, effort) for position, velocity, _, effort in states]).T
        return direct if np.array_equal(direct.read(), told) else None

    def read(self):
        """Return positions, velocities and the drives' efforts, (3, n), after the last step."""
        values = np.empty((3, self._indices.shape[1]))
        if not _read(self._handle, self._body, values, self._sensor):
            raise BulletSimError("Bullet knows no joints of body %d; has it been removed?" % self._body)
        return values

    def drive_position(self, index, position, velocity, max_effort, gain):
        """As ``Model.drive_position``; all (k,). The motor adds ``velocity`` to what closes the gap with ``gain``.

        Raises BulletSimError for a joint that there is none of, and for arrays of other lengths.
        """
        # Another type of number, or every second one of an array, would be compiled for when it first comes.
        index = np.ascontiguousarray(index, dtype=np.intp)
        position, velocity, max_effort = (
            np.ascontiguousarray(values, dtype=float) for values in (position, velocity, max_effort)
        )
        if not _drive_position(self._handle, self._body, self._indices, index, position, velocity, max_effort, gain):
            raise BulletSimError(
                "joints %s with %d positions, %d velocities and %d efforts; expected joints from 0 to %d and one of "
                "each for each of them"
                % (index.tolist(), len(position), len(velocity), len(max_effort), self._indices.shape[1] - 1)
            )


def client_handle(client):
    """Return the address by which Bullet's C interface knows PyBullet's physics client number ``client``, or None.

    PyBullet has a function that says it, but does not export it: it is looked up in the library's symbol table, which a
    build may have been stripped of.
    """
    library = ctypes.PyDLL(pybullet.__file__)
    exported = "b3SubmitClientCommandAndWaitStatus"
    if not all(hasattr(library, name) for name in _FUNCTIONS):
        return None
    values = _symbol_values(pybullet.__file__, ("getPhysicsClient", exported))
    if values is None:
        return None
    loaded_at = ctypes.cast(getattr(library, exported), ctypes.c_void_p).value - values[1]
    llvmlite.binding.load_library_permanently(pybullet.__file__)
    return ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_int)(loaded_at + values[0])(client)


def _symbol_values(path, names):
    """Return where in an ELF file functions begin, by their names, or None unless it says so of each, once."""
    try:
        return _values_in_table(path, names)
    except (struct.error, IndexError, ValueError):  # cut off, or made of something else
        return None


def _values_in_table(path, names):
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as image:
        if image[: len(_ELF64)] != _ELF64:
            return None
        begin, = struct.unpack_from("<Q", image, _SECTIONS_AT)
        size, count = struct.unpack_from("<HH", image, _SECTION_SIZE_AT)
        sections = [_SECTION.unpack_from(image, begin + size * number) for number in range(count)]
        tables = [section for section in sections if section[_TYPE] == _SYMBOL_TABLE]
        if not tables:
            return None
        table, texts = tables[0], sections[tables[0][_LINK]]
        symbols = np.frombuffer(image[table[_OFFSET] : table[_OFFSET] + table[_SIZE]], dtype=_SYMBOL)
        text = image[texts[_OFFSET] : texts[_OFFSET] + texts[_SIZE]]
    functions = symbols[(symbols["info"] & _KIND == _FUNCTION) & (symbols["section"] != _UNDEFINED)]
    # An index that fails is a ValueError: the name is not among the texts.
    found = [functions["value"][functions["name"] == text.index(b"\0%s\0" % name.encode()) + 1] for name in names]
    return [int(values[0]) for values in found] if all(len(values) == 1 for values in found) else None


@_compiled
def _read(handle, body, values, sensor):
    status = _submit(handle, _request_state(handle, body))
    # False for a body that is gone, of which the status still holds what was asked of another.
    if not _get_state(status, 0, 0, 0, 0, 0, 0, 0):
        return False
    for joint in range(values.shape[1]):
        if not _get_joint_state(handle, status, joint, sensor.ctypes.data):
            return False
        values[0, joint], values[1, joint], values[2, joint] = sensor[0], sensor[1], sensor[_MOTOR]
    return True


@_compiled
def _drive_position(handle, body, indices, index, position, velocity, max_effort, gain):
    count = len(index)
    if not (len(position) == len(velocity) == len(max_effort) == count):
        return False
    for k in range(count):
        if not 0 <= index[k] < indices.shape[1]:
            return False
    command = _control(handle, body, _POSITION_CONTROL)
    for k in range(count):
        q, u = indices[0, index[k]], indices[1, index[k]]
        _set_position(command, q, position[k])
        _set_kp(command, u, gain)
        _set_velocity(command, u, velocity[k])
        _set_kd(command, u, 1.0)
        _set_force(command, u, max_effort[k])
    _submit(handle, command)
    return True
