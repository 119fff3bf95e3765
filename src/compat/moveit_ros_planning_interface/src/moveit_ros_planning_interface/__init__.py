# SPDX-License-Identifier: BSD-3-Clause
"""Names that programs import from MoveIt's package; the work is moveit_commander's."""
