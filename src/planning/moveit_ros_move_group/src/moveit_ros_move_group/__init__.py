# SPDX-License-Identifier: BSD-3-Clause
"""The node move_group: motion planning behind MoveIt's actions, services and topics."""
