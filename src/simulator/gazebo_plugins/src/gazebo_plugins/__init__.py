# SPDX-License-Identifier: BSD-3-Clause
"""Model plugins that drive vehicles, under the file names of Gazebo's."""
