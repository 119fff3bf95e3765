# SPDX-License-Identifier: BSD-3-Clause
"""Shared by all processes that draw the world: its state, the pictures on its screens, simplified meshes."""
