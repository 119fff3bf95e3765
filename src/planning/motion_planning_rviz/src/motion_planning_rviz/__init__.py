# SPDX-License-Identifier: BSD-3-Clause
"""Planning from within rviz, without a panel: markers to drag, a menu, drawings of goal, path and scene."""
