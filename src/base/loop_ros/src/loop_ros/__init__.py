# SPDX-License-Identifier: BSD-3-Clause
"""Topics, services, actions and settings for a loop that must never wait."""
