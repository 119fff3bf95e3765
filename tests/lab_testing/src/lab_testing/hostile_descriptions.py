# SPDX-License-Identifier: BSD-3-Clause
"""Descriptions and meshes that are written by mistake or to do harm: too large, endless, or inconsistent."""
import struct

import numpy as np

_COLLADA = """<?xml version="1.0"?><!DOCTYPE c [%s]>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><extra>&e8;</extra></COLLADA>"""


def write_ball(path, across, announced=None, radius=1.0):
    """Write a ball of 2 * ``across`` ** 2 triangles as a binary STL, whose header gives the count ``announced`` if
    set."""
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, across + 1), np.linspace(0.01, 3.13, across + 1))
    points = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
    i = (np.arange(across)[:, None] * (across + 1) + np.arange(across)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + across + 1], 1),
                            np.stack([i + 1, i + across + 2, i + across + 1], 1)])
    records = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    records["corners"] = radius * points[faces]
    with open(path, "wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", len(faces) if announced is None else announced) + records.tobytes())


def write_entity_bomb(path):
    """Write a Collada file of 900 bytes whose entities, expanded, are a gigabyte."""
    with open(path, "w", encoding="utf-8") as file:
        file.write(_COLLADA % "".join("<!ENTITY e%d '%s'>" % (k, ("&e%d;" % (k - 1) if k else "aaaaaaaaaa") * 10)
                                      for k in range(9)))


def chain(links):
    """A URDF with this many links, all fixed to the first."""
    return "<robot name='m'>%s%s</robot>" % ("".join("<link name='l%d'/>" % k for k in range(links)), "".join(
        "<joint name='j%d' type='fixed'><parent link='l0'/><child link='l%d'/></joint>" % (k, k)
        for k in range(1, links)))
