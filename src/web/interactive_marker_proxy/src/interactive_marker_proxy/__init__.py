# SPDX-License-Identifier: BSD-3-Clause
"""Interactive markers for web pages: in one frame, and with a service for the first state."""
