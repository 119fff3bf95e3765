# SPDX-License-Identifier: BSD-3-Clause
"""Many labs on one host, each behind walls, with one front door: a class."""
