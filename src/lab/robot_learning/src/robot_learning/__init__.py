# SPDX-License-Identifier: BSD-3-Clause
"""Policies that learn tasks from demonstrations, in NumPy."""
