"""Ball on a beam that tilts about its centre, as a slider: the ball turns with the beam and does not roll.

Zero: beam level, ball at the pivot. x points right along the level beam, z up; theta > 0 lifts the beam's
+x end, so the pivot axis is -y; r grows towards that end. J is the beam's inertia about the pivot, its centre
of mass, where its mass is not felt and left out; J_b is the ball's about its own centre, which moves on a line
through the pivot. The paper's term J_b/R^2 of rolling is absent.
Source: Hauser, Sastry, Kokotovic, Nonlinear control via approximate input-output linearization: the ball
and beam example, IEEE Transactions on Automatic Control 37 (1992), section II; its J, with a heavier ball.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, System

r, theta = dynamicsymbols("r theta")
M, J, J_b, g = sp.symbols("M J J_b g", positive=True)

ball = r * sp.Matrix([sp.cos(theta), sp.sin(theta)])
velocity = ball.diff(TIME)

SYSTEM = System(
    coordinates={r: "slide", theta: "pivot"},
    kinetic=M * velocity.dot(velocity) / 2 + (J + J_b) * theta.diff(TIME) ** 2 / 2,
    potential=M * g * ball[1],
    parameters={
        M: (0.5, "kg"),
        J: (0.02, "kg m^2"),
        J_b: (0.0005, "kg m^2"),
        g: (9.81, "m/s^2"),
    },
    total_mass=M,
    gravity=g,
    ranges={r: (-0.5, 0.5), r.diff(TIME): (-2.0, 2.0)},
)
