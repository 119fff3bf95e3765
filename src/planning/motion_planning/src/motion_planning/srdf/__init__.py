# SPDX-License-Identifier: BSD-3-Clause
"""SRDF: a robot's data for planning in addition to its URDF, as plain data."""
from motion_planning.srdf.data import DisabledPair, EndEffector, GroupEntry, GroupState, Srdf, VirtualJoint
from motion_planning.srdf.reader import SrdfError, parse_srdf
from motion_planning.srdf.writer import element_of, with_disabled_pairs

__all__ = ["DisabledPair", "EndEffector", "GroupEntry", "GroupState", "Srdf", "SrdfError", "VirtualJoint",
           "element_of", "parse_srdf", "with_disabled_pairs"]
