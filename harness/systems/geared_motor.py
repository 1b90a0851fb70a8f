"""Arm on a motor behind a gear: the rotor turns n times as fast as the arm, and its inertia counts n^2 times at the joint.

Zero: arm hanging. x points right, z up; theta > 0 swings the arm towards -x, so the axis of the shaft is +y.
The inertia I_G is the arm's about its centre of mass. The control is the torque tau_m of the motor, which is held within its stall torque;
the rotor's bearings rub by b per unit of its own rate.
Source: Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, chapter 6 (actuator dynamics: a motor, its gear and its link).
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Actuator, System

theta = dynamicsymbols("theta")
m, r_G, I_G, J, n, b, g = sp.symbols("m r_G I_G J n b g", positive=True)
tau_m, tau_low, tau_high = sp.symbols("tau_m tau_low tau_high", real=True)
rate = theta.diff(TIME)

SYSTEM = System(
    coordinates={theta: "shaft"},
    kinetic=(I_G + m * r_G**2) * rate**2 / 2 + J * (n * rate) ** 2 / 2,
    potential=-m * g * r_G * sp.cos(theta),
    generalised_forces={theta: -n * (b * n * rate)},
    actuators={"motor": Actuator(control=tau_m, force=tau_m, moments={theta: n}, control_range=(tau_low, tau_high))},
    parameters={
        m: (3.0, "kg"),
        r_G: (0.4, "m"),
        I_G: (0.2, "kg m^2"),
        J: (2e-4, "kg m^2"),
        n: (50.0, ""),
        b: (1e-4, "N m s"),
        tau_low: (-0.3, "N m"),
        tau_high: (0.3, "N m"),
        g: (9.81, "m/s^2"),
    },
    total_mass=m,
    gravity=g,
)
