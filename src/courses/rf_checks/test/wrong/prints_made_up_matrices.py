# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Prints numbers that were true once, elsewhere."""
for _ in range(3):
    print("[[0.0 -1.0 0.0 0.64]\n [1.0 0.0 0.0 0.83]\n [0.0 0.0 1.0 0.32]\n [0.0 0.0 0.0 1.0]]")
