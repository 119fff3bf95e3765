# SPDX-License-Identifier: BSD-3-Clause
"""The node's services and actions, grouped as MoveIt's capabilities."""
