# SPDX-License-Identifier: BSD-3-Clause
"""The messages (``msg``) and services (``srv``) of the controller manager; ``utils`` finds managers and controllers."""
