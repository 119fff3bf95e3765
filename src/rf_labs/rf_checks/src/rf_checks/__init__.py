# SPDX-License-Identifier: BSD-3-Clause
"""The labs' checks: what an exercise asks for, what a program did, and what to tell its author."""
