"""MJCF of the chain of n equal uniform bars: m = 1.5 kg, L = 0.5 m, hanging from a fixed pin.

A bar's centre of mass lies half its length below its pin; its inertia about it is m L^2 / 12 =
0.03125 kg m^2 across the bar and, which no motion feels, the least MuJoCo accepts along it.
Source: Greenwood, Principles of Dynamics, 2nd ed., section 6-6.
"""


def model(n: int) -> str:
    """The chain of ``n`` bars, each body nested in the one above."""
    opening, closing = [], []
    for i in range(1, n + 1):
        place = ' pos="0 0 -0.5"' if i > 1 else ""
        opening += [
            f'<body name="bar_{i}"{place}>',
            f'<joint name="joint_{i}" type="hinge" axis="0 -1 0"/>',
            '<inertial pos="0 0 -0.25" mass="1.5" diaginertia="0.03125 0.03125 1e-15"/>',
        ]
        closing.append("</body>")
    return "\n".join(
        [
            f'<mujoco model="chain_{n}">',
            '<compiler angle="radian"/>',
            '<option gravity="0 0 -9.81">',
            '<flag constraint="disable" contact="disable" actuation="disable" sensor="disable" spring="disable" damper="disable"/>',
            "</option>",
            "<worldbody>",
            *opening,
            *closing,
            "</worldbody>",
            "</mujoco>",
            "",
        ]
    )
