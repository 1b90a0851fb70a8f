"""Clavel's delta robot: three arms about the vertical, each an upper arm that a motor turns and a forearm on ball-like joints.

Zero: upper arms and forearms straight out from the base, platform in the origin, where the loops are open. z points up; the platform
slides along x, y and z and does not turn, as the parallelograms of the forearms see to; here a bar stands for each of them. Arms stand at
the azimuths 0, beta and -beta, in frames whose x points outward. A universal joint carries a forearm: elbow, about -y as the shoulder,
so that positive angles raise what points outward, measured from the upper arm; then swing, about the forearm's z. The forearm's end
meets the platform at the distance r_p from its centre. The platform hangs under the base, and elbows point outward. All arms are uniform
bars; forearms have the inertia J about their own length.
Source: Clavel, Conception d'un robot parallele rapide a 4 degres de liberte, these EPFL 925 (1991); Merlet, Parallel Robots, 2nd ed.,
section 2.2.
"""

import sympy as sp
from sympy import rot_ccw_axis3
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

x, y, z = dynamicsymbols("x y z")
r_b, r_p, L_u, L_f, beta, m_u, m_f, J, m, g = sp.symbols("r_b r_p L_u L_f beta m_u m_f J m g", positive=True)

platform = sp.Matrix([x, y, z])
kinetic, potential = m * platform.diff(TIME).dot(platform.diff(TIME)) / 2, m * g * z
coordinates, constraints, assembly = {x: "x", y: "y", z: "z"}, {}, {z: -0.7}
for name, azimuth in (("a", sp.S.Zero), ("b", beta), ("c", -beta)):
    shoulder, elbow, swing = dynamicsymbols(f"shoulder_{name} elbow_{name} swing_{name}")
    raised = shoulder + elbow
    # In the arm's frame.
    upper = sp.Matrix([sp.cos(shoulder), 0, sp.sin(shoulder)])
    fore = sp.Matrix([sp.cos(swing) * sp.cos(raised), sp.sin(swing), sp.cos(swing) * sp.sin(raised)])
    at_elbow = sp.Matrix([r_b, 0, 0]) + L_u * upper
    middle = at_elbow + L_f / 2 * fore
    # Along the forearm's length, and across it.
    rates = sp.Matrix([-raised.diff(TIME) * sp.sin(swing), -raised.diff(TIME) * sp.cos(swing), swing.diff(TIME)])
    across = m_f * L_f**2 / 12
    kinetic += m_u * L_u**2 / 6 * shoulder.diff(TIME) ** 2
    kinetic += m_f * middle.diff(TIME).dot(middle.diff(TIME)) / 2 + rates.dot(sp.diag(J, across, across) * rates) / 2
    potential += m_u * g * L_u / 2 * sp.sin(shoulder) + m_f * g * middle[2]
    turned = rot_ccw_axis3(azimuth)
    gap = turned * (at_elbow + L_f * fore - sp.Matrix([r_p, 0, 0])) - platform
    coordinates |= {q: q.name for q in (shoulder, elbow, swing)}
    constraints[f"forearm_{name}"] = Constraint(rows=gap, determines=[shoulder, elbow, swing])
    assembly |= {shoulder: -0.065, elbow: -2.055}

SYSTEM = System(
    coordinates=coordinates,
    kinetic=kinetic,
    potential=potential,
    parameters={r_b: (0.2, "m"), r_p: (0.08, "m"), L_u: (0.3, "m"), L_f: (0.8, "m"), beta: (2.0943951023931953, "rad"), g: (9.81, "m/s^2")}
    | {m_u: (0.4, "kg"), m_f: (0.15, "kg"), J: (0.0002, "kg m^2"), m: (0.5, "kg")},
    total_mass=m + 3 * m_u + 3 * m_f,
    gravity=g,
    ranges={x: (-0.15, 0.15), y: (-0.15, 0.15), z: (-0.8, -0.6)} | {q.diff(TIME): (-2.0, 2.0) for q in (x, y, z)},
    constraints=constraints,
    assembly=assembly,
)
