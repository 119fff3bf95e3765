# SPDX-License-Identifier: BSD-3-Clause
"""Chosen transforms for web pages, looked up here and sent when they have changed."""
