# SPDX-License-Identifier: BSD-3-Clause
"""Shared code of the tests of several packages."""
