# SPDX-License-Identifier: BSD-3-Clause
"""What the workspace's environment does for programs that know nothing of it."""
