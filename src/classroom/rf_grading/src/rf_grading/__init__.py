# SPDX-License-Identifier: BSD-3-Clause
"""Grades a class: reads its submissions, has them judged in parallel, writes results and pages."""
