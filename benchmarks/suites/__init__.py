"""Suites of benchmarks: each module has ``benchmarks()``, which yields the declarations of its own.

A suite is named as its module, and the names of its benchmarks begin with that name. Modules import the harness where they are asked for
their benchmarks or prepare one, so that a state of the code which lacks a name fails in one benchmark.
"""

# Trees that a URDF can express, from one to seven degrees of freedom: hinges, slides, a ball joint, a free joint; sparse and dense.
MECHANISMS = (
    "spring_damper", "double_pendulum", "cart_pendulum", "spherical_pendulum", "arm_3r", "scara", "biped_five_link", "puma_560",
    "stanford_arm", "quadrotor", "free_body", "arm_7r",
)  # fmt: skip
ARMS = ("arm_7r", "puma_560", "stanford_arm")
# States of a call: of what costs a microsecond each, and of what costs a thousand times as much.
MANY, FEW = 2_000, 100
