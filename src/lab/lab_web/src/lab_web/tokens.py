# SPDX-License-Identifier: BSD-3-Clause
"""The names of the variables that give the page its tokens: every user of a machine can read command lines."""

TOKEN, VIEW_TOKEN = "LAB_WEB_TOKEN", "LAB_WEB_VIEW_TOKEN"
