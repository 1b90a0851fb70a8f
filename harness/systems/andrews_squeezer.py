"""Andrews' squeezing mechanism: seven bodies in a plane, three loops through one pin, one spring, no gravity.

Zero of all angles: K1 along +x, K2 from its end along -x, the pin of the triangle K3 below its foot, K5 along +x with K4 hanging from its
end, K7 hanging with K6 along +x from its end; the loops are open there. x points right, z is the text's y; positive angles turn +x towards
+z, so all axes are -y. theta turns K2 against K1, phi K4 against K5, Omega K6 against K7. The ends of K2, K3, K4 and K6 meet in
one pin. A motor turns K1 with 0.033 N m, which is an applied force here. The text's motion starts at the dead point theta = 0, where K1
moves no other body: there the spring's force on K1 cancels, with its digits; the range keeps away from it.
Source: Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., section VII.7; Schiehlen, Multibody Systems Handbook (1990);
IFToMM library of computational benchmark problems, A03.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

beta, theta, gamma, phi, delta, omega, epsilon = joints = dynamicsymbols("beta theta gamma phi delta Omega epsilon")
masses, inertias = sp.symbols("m1:8", positive=True), sp.symbols("I1:8", positive=True)
ra, rr, da, d, sa, sb, sc, sd, ss, ta, tb, zt, e, ea = sp.symbols("ra rr da d sa sb sc sd ss ta tb zt e ea", positive=True)
u, ua, ub, zf, fa, yb, xc, yc, c0, l0 = sp.symbols("u ua ub zf fa yb xc yc c0 l0", positive=True)
xa, ya, xb = sp.symbols("xa ya xb", negative=True)


def turned(angle, x, y):
    """The point (x, y) of a body that is turned by ``angle``."""
    return sp.Matrix([x * sp.cos(angle) - y * sp.sin(angle), x * sp.sin(angle) + y * sp.cos(angle)])


A, B, C = sp.Matrix([xa, ya]), sp.Matrix([xb, yb]), sp.Matrix([xc, yc])
F, G, H, D = turned(beta, rr, 0), A + turned(delta, zt, 0), A + turned(epsilon, 0, -u), B + turned(gamma, sd, -sc)
turns = [beta, beta + theta, gamma, phi + delta, delta, omega + epsilon, epsilon]
centres = [
    turned(beta, ra, 0),
    F + turned(turns[1], -da, 0),
    B + turned(gamma, sb, -sa),
    G + turned(turns[3], 0, ea - e),
    A + turned(delta, ta, tb),
    H + turned(turns[5], zf - fa, 0),
    A + turned(epsilon, -ub, -ua),
]
pin = F + turned(turns[1], -d, 0)
pins = {"pin_3": B + turned(gamma, 0, -ss), "pin_4": G + turned(turns[3], 0, -e), "pin_6": H + turned(turns[5], zf, 0)}
determined = {"pin_3": (theta, gamma), "pin_4": (phi, delta), "pin_6": (omega, epsilon)}
bodies = zip(masses, inertias, turns, centres, strict=True)

SYSTEM = System(
    coordinates={q: q.func.__name__ for q in joints},
    kinetic=sum(m * at.diff(TIME).dot(at.diff(TIME)) / 2 + inertia * turn.diff(TIME) ** 2 / 2 for m, inertia, turn, at in bodies),
    potential=c0 * (sp.sqrt((D - C).dot(D - C)) - l0) ** 2 / 2,
    parameters=dict(zip(masses, [(m, "kg") for m in (0.04325, 0.00365, 0.02373, 0.00706, 0.0705, 0.00706, 0.05498)], strict=True))
    | dict(
        zip(
            inertias,
            [(inertia, "kg m^2") for inertia in (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)],
            strict=True,
        )
    )
    | {xa: (-0.06934, "m"), ya: (-0.00227, "m"), xb: (-0.03635, "m"), yb: (0.03273, "m"), xc: (0.014, "m"), yc: (0.072, "m")}
    | {ra: (0.00092, "m"), rr: (0.007, "m"), da: (0.0115, "m"), d: (0.028, "m"), e: (0.02, "m"), ea: (0.01421, "m")}
    | {sa: (0.01874, "m"), sb: (0.01043, "m"), sc: (0.018, "m"), sd: (0.02, "m"), ss: (0.035, "m"), zt: (0.04, "m")}
    | {ta: (0.02308, "m"), tb: (0.00916, "m"), u: (0.04, "m"), ua: (0.01228, "m"), ub: (0.00449, "m"), zf: (0.02, "m")}
    | {fa: (0.01421, "m"), c0: (4530.0, "N/m"), l0: (0.07785, "m")},
    total_mass=sum(masses),
    ranges={beta: (0.3, 5.8)} | {q.diff(TIME): (-100.0, 100.0) for q in joints},
    constraints={name: Constraint(rows=pin - other, determines=determined[name]) for name, other in pins.items()},
    assembly={beta: -0.062, gamma: 0.455, phi: 0.223, delta: 0.487, omega: -0.223, epsilon: 1.231},
)
