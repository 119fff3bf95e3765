# SPDX-License-Identifier: BSD-3-Clause
"""The node web_video_server."""
