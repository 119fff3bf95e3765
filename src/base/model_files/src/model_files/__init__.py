# SPDX-License-Identifier: BSD-3-Clause
"""Finds the files that robot descriptions and worlds name; holds the models that this workspace brings."""
