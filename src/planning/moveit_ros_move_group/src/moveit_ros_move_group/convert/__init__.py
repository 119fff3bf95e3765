# SPDX-License-Identifier: BSD-3-Clause
"""Messages to the planning core's types and back: the one place that knows both."""
