# SPDX-License-Identifier: BSD-3-Clause
"""The lab's page in a browser, and the server behind it."""
