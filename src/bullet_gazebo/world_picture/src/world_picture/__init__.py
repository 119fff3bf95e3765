# SPDX-License-Identifier: BSD-3-Clause
"""What processes that draw the world share: its state, the pictures on its screens, meshes that are light enough."""
