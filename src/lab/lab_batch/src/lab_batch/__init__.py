# SPDX-License-Identifier: BSD-3-Clause
"""Runs a job once for each seed, in several processes or on several machines. Free of ROS."""
from .job import Job, JobError, Outcome, Spec, load

__all__ = ["Job", "JobError", "Outcome", "Spec", "load"]
