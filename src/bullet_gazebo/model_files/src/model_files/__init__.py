# SPDX-License-Identifier: BSD-3-Clause
"""Where the files are that robot descriptions and worlds speak of, and the models that come along."""
