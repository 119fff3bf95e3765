# SPDX-License-Identifier: BSD-3-Clause
"""ROS for programs in browsers: messages as values, clients with bounded buffers, the protocols of rosbridge and
Foxglove, one web server.
"""
