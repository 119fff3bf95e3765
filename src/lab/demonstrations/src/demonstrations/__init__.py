# SPDX-License-Identifier: BSD-3-Clause
"""Demonstrations of tasks for learning: experts, recording, files."""
