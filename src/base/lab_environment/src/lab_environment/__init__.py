# SPDX-License-Identifier: BSD-3-Clause
"""The workspace's environment for unmodified programs."""
