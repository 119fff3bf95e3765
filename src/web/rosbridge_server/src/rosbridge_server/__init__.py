# SPDX-License-Identifier: BSD-3-Clause
"""The node rosbridge_websocket."""
