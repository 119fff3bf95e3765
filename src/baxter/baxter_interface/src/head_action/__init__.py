# SPDX-License-Identifier: BSD-3-Clause
"""The SDK's action server for the head."""
