# SPDX-License-Identifier: BSD-3-Clause
"""The labs' checks: the requirements of an exercise, the actions of a program, and the hint to its author."""
