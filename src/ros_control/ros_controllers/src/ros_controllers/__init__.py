# SPDX-License-Identifier: BSD-3-Clause
"""The controllers that robots are configured with; ``config/controllers.yaml`` says which type is which class."""
