"""Kinetic and potential energy of a serial arm, from a table of its links.

Every link frame is parallel to the base frame in the zero configuration, so that successive frames
differ by the turn about the joint's axis and by an offset alone. With R_i the rotation from frame i to
frame i-1, a_i the axis, p_i the offset and c_i the centre of mass,

    revolute:   omega_i = R_i' omega_{i-1} + a_i qdot_i,  v_i = R_i' (v_{i-1} + omega_{i-1} x p_i)
    prismatic:  omega_i = omega_{i-1},  v_i = v_{i-1} + omega_{i-1} x (p_i + a_i q_i) + a_i qdot_i

    T = sum m_i/2 |v_i + omega_i x c_i|^2 + 1/2 omega_i . I_i omega_i

Source: Craig, Introduction to Robotics, 3rd ed., equations 5.45 to 5.48, 6.69 to 6.71.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import sympy as sp

from harness import TIME

AXES = {"x": sp.Matrix([1, 0, 0]), "y": sp.Matrix([0, 1, 0]), "z": sp.Matrix([0, 0, 1])}


@dataclass(frozen=True, kw_only=True)
class Link:
    """One link, in its own frame, whose origin lies on the axis of its joint.

    Attributes:
        joint: "revolute" or "prismatic".
        axis: "x", "y" or "z"; a leading minus reverses it.
        offset: this frame's origin in the frame of the link before, at q = 0 [m].
        mass: [kg]
        centre: centre of mass [m].
        inertia: moments Ixx, Iyy, Izz about the centre of mass [kg m^2].
        inertia_at_origin: the same about the frame's origin, where a table gives it there, with no
            products of inertia; then ``inertia`` is left out.
    """

    joint: str
    axis: str
    offset: tuple = (0, 0, 0)
    mass: sp.Expr = 0
    centre: tuple = (0, 0, 0)
    inertia: tuple = (0, 0, 0)
    inertia_at_origin: tuple = ()


def energies(links: Mapping[sp.Expr, Link], gravity: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    """(T, V) [J] of the arm whose coordinates carry ``links``, in order from the base; z points up."""
    omega, v = sp.zeros(3, 1), sp.zeros(3, 1)
    up, height = AXES["z"], sp.S.Zero
    kinetic = potential = sp.S.Zero
    for q, link in links.items():
        axis = -AXES[link.axis[1]] if link.axis.startswith("-") else AXES[link.axis]
        offset, rate = sp.Matrix(link.offset), q.diff(TIME)
        if link.joint == "prismatic":
            offset += axis * q
        v = v + omega.cross(offset)
        height = height + up.dot(offset)
        if link.joint == "prismatic":
            v = v + axis * rate
        else:
            v, up, omega = (_turned_back(vector, axis, q) for vector in (v, up, omega))
            omega = omega + axis * rate
        centre = sp.Matrix(link.centre)
        if link.inertia_at_origin:
            kinetic += link.mass * (v.dot(v) / 2 + v.dot(omega.cross(centre))) + _moments(link.inertia_at_origin, omega) / 2
        else:
            of_centre = v + omega.cross(centre)
            kinetic += link.mass * of_centre.dot(of_centre) / 2 + _moments(link.inertia, omega) / 2
        potential += link.mass * gravity * (height + up.dot(centre))
    return kinetic, potential


def table(unit: str, symbols: Iterable[sp.Symbol], values: Iterable[float]) -> dict[sp.Symbol, tuple[float, str]]:
    """Parameters of one unit."""
    return {symbol: (value, unit) for symbol, value in zip(symbols, values, strict=True)}


def _turned_back(vector: sp.Matrix, axis: sp.Matrix, angle: sp.Expr) -> sp.Matrix:
    """R' vector for the rotation R by ``angle`` about a coordinate axis (Rodrigues)."""
    along = axis * axis.dot(vector)
    return along + (vector - along) * sp.cos(angle) - axis.cross(vector) * sp.sin(angle)


def _moments(inertia: tuple, omega: sp.Matrix) -> sp.Expr:
    return sum(moment * rate**2 for moment, rate in zip(inertia, omega, strict=True))
