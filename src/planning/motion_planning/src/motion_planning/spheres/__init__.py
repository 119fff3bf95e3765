# SPDX-License-Identifier: BSD-3-Clause
"""Robots as spheres, checked many configurations at once by compiled code."""
from motion_planning.spheres.checker import RESOLUTION, SphereChecker
from motion_planning.spheres.cover import CoverError
from motion_planning.spheres.sphere_model import Patience, SphereModel
from motion_planning.spheres.tables import make_links

__all__ = ["RESOLUTION", "CoverError", "Patience", "SphereChecker", "SphereModel", "make_links"]
