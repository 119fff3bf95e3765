# SPDX-License-Identifier: BSD-3-Clause
"""Amendments of rospy, rosgraph, actionlib, roslaunch and Python, so that unmodified programs run as they should.

:mod:`rospy_fixes.table` lists them all and applies them; each has a module with a function ``amend(module)``.
"""
