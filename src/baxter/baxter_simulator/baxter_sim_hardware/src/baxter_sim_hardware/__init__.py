# SPDX-License-Identifier: BSD-3-Clause
"""The behaviour of the simulated Baxter: the state table, command modes and time-outs, end-point forces.

`plugin.BaxterPlugin` runs it in a world. Nothing is imported here: the cameras' process and `spawn_baxter` use modules
of this package too, and need neither the arms nor their compiled code, which takes 23 MB.
"""
