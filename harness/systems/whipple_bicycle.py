"""Whipple's bicycle, hands off: rear wheel, rear frame with its rider, front frame and front wheel, on knife edges that roll.

Zero: bicycle upright, heading along x, steered straight, its rear contact at the origin. z points up; x and y are the way of the rear
wheel's centre, whose height is r_R cos(lean). The rear frame yaws about the vertical, leans about its heading, to the right where lean > 0,
and pitches about the rear axle, nose down where pitch > 0; the front frame turns about the steer axis, tilted back by lambda, to the left
where steer > 0; both wheels spin forward in their frames. The lowest point of the front wheel is on the ground, which determines pitch.
Both contacts are at rest: two rows each, since their vertical rates are zero by the heights. States lean to the right, as the upright
bicycle at rest is an equilibrium where nothing rounded is exact. No engine has rolling, so there are no models.
Source: Meijaard, Papadopoulos, Ruina, Schwab, Linearized dynamics equations for the balance and steer of a bicycle: a benchmark and
review, Proc. R. Soc. A 463 (2007), with the parameters of its table 1, in whose axes y points to the right and z down; Basu-Mandal,
Chatterjee, Papadopoulos, Hands-free circular motions of a benchmark bicycle, Proc. R. Soc. A 463 (2007), not linearised.
"""

import math

import sympy as sp
from sympy import rot_ccw_axis1, rot_ccw_axis2, rot_ccw_axis3
from sympy.physics.mechanics import dynamicsymbols

from harness import TIME, Constraint, System

x, y, yaw, lean, pitch, rear, steer, front = dynamicsymbols("x y yaw lean pitch rear steer front")
w, c, tilt, g = sp.symbols("w c lambda g", positive=True)
r_R, m_R, R_xx, R_yy = sp.symbols("r_R m_R I_Rxx I_Ryy", positive=True)
r_F, m_F, F_xx, F_yy = sp.symbols("r_F m_F I_Fxx I_Fyy", positive=True)
x_B, z_B, m_B, B_xx, B_xz, B_yy, B_zz = sp.symbols("x_B z_B m_B I_Bxx I_Bxz I_Byy I_Bzz", real=True)
x_H, z_H, m_H, H_xx, H_xz, H_yy, H_zz = sp.symbols("x_H z_H m_H I_Hxx I_Hxz I_Hyy I_Hzz", real=True)

ahead, left, up = (sp.Matrix([int(i == j) for j in range(3)]) for i in range(3))
# From the axes of one frame to those of the frame before: of the leaning rear wheel, the rear frame, the front frame.
lean_turn = rot_ccw_axis3(yaw) * rot_ccw_axis1(lean)
pitch_turn = rot_ccw_axis2(pitch)
steer_turn = rot_ccw_axis2(-tilt) * rot_ccw_axis3(steer) * rot_ccw_axis2(tilt)
# Places where the bicycle is at zero: from the rear wheel's centre, and from where the steer axis meets the ground.
axis_foot, rear_mass = sp.Matrix([w + c, 0, -r_R]), sp.Matrix([x_B, 0, -z_B - r_R])
front_hub, front_mass = sp.Matrix([-c, 0, r_F]), sp.Matrix([x_H - w - c, 0, -z_H])

# Angular velocities and velocities along the axes of each frame.
turn_of_lean = rot_ccw_axis1(lean).T * up * yaw.diff(TIME) + ahead * lean.diff(TIME)
turn_of_B = pitch_turn.T * turn_of_lean + left * pitch.diff(TIME)
turn_of_R = turn_of_lean + left * (pitch.diff(TIME) + rear.diff(TIME))
turn_of_H = steer_turn.T * turn_of_B + rot_ccw_axis2(-tilt) * up * steer.diff(TIME)
turn_of_F = turn_of_H + left * front.diff(TIME)
rear_hub = sp.Matrix([x, y, r_R * sp.cos(lean)])
velocity_R = lean_turn.T * rear_hub.diff(TIME)
velocity_B = pitch_turn.T * velocity_R + turn_of_B.cross(rear_mass)
velocity_foot = steer_turn.T * (pitch_turn.T * velocity_R + turn_of_B.cross(axis_foot))
velocity_H = velocity_foot + turn_of_H.cross(front_mass)
velocity_F = velocity_foot + turn_of_H.cross(front_hub)

# The vertical along the axes of each frame, and heights.
up_B = pitch_turn.T * lean_turn.T * up
up_H = steer_turn.T * up_B
height_B = rear_hub[2] + up_B.dot(rear_mass)
height_foot = rear_hub[2] + up_B.dot(axis_foot)
height_H, height_F = (height_foot + up_H.dot(place) for place in (front_mass, front_hub))

# The front wheel touches where its plane, across its axle, falls most steeply from the hub.
steepest = sp.sqrt(up_H[0] ** 2 + up_H[2] ** 2)
to_front_contact = -r_F * sp.Matrix([up_H[0], 0, up_H[2]]) / steepest
rear_contact = lean_turn * (velocity_R + turn_of_R.cross(-r_R * up))
front_contact = lean_turn * pitch_turn * steer_turn * (velocity_F + turn_of_F.cross(to_front_contact))


def inertia(xx: sp.Expr, yy: sp.Expr, zz: sp.Expr, xz: sp.Expr = sp.S.Zero) -> sp.Matrix:
    """In axes of which y and z point the other way, where the product of inertia changes its sign."""
    return sp.Matrix([[xx, 0, -xz], [0, yy, 0], [-xz, 0, zz]])


bodies = [
    (m_R, velocity_R, rear_hub[2], inertia(R_xx, R_yy, R_xx), turn_of_R),
    (m_B, velocity_B, height_B, inertia(B_xx, B_yy, B_zz, B_xz), turn_of_B),
    (m_H, velocity_H, height_H, inertia(H_xx, H_yy, H_zz, H_xz), turn_of_H),
    (m_F, velocity_F, height_F, inertia(F_xx, F_yy, F_xx), turn_of_F),
]

SYSTEM = System(
    coordinates={q: q.name for q in (x, y, yaw, lean, pitch, rear, steer, front)},
    kinetic=sum(m * v.dot(v) / 2 + turn.dot(moments * turn) / 2 for m, v, _, moments, turn in bodies),
    potential=sum(m * g * height for m, _, height, _, _ in bodies),
    parameters={w: (1.02, "m"), c: (0.08, "m"), tilt: (math.pi / 10, "rad"), g: (9.81, "m/s^2")}
    | {r_R: (0.3, "m"), m_R: (2.0, "kg"), R_xx: (0.0603, "kg m^2"), R_yy: (0.12, "kg m^2")}
    | {x_B: (0.3, "m"), z_B: (-0.9, "m"), m_B: (85.0, "kg")}
    | {B_xx: (9.2, "kg m^2"), B_xz: (2.4, "kg m^2"), B_yy: (11.0, "kg m^2"), B_zz: (2.8, "kg m^2")}
    | {x_H: (0.9, "m"), z_H: (-0.7, "m"), m_H: (4.0, "kg")}
    | {H_xx: (0.05892, "kg m^2"), H_xz: (-0.00756, "kg m^2"), H_yy: (0.06, "kg m^2"), H_zz: (0.00708, "kg m^2")}
    | {r_F: (0.35, "m"), m_F: (3.0, "kg"), F_xx: (0.1405, "kg m^2"), F_yy: (0.28, "kg m^2")},
    total_mass=m_R + m_B + m_H + m_F,
    gravity=g,
    ranges={x: (-5.0, 5.0), y: (-5.0, 5.0), lean: (0.05, 0.7), pitch: (-0.5, 0.5), steer: (-0.8, 0.8)}
    | {lean.diff(TIME): (-2.0, 2.0), steer.diff(TIME): (-3.0, 3.0), rear.diff(TIME): (-20.0, 20.0)},
    constraints={
        "ground": Constraint(rows=[height_F - r_F * steepest], determines=[pitch]),
        "rear_contact": Constraint(rows=rear_contact[:2], determines=[x, y]),
        "front_contact": Constraint(rows=front_contact[:2], determines=[yaw, front]),
    },
)
