"""MJCF of the chain of n uniform bars of 1 kg and 0.5 m each, hanging from a fixed pin at the origin.

A bar's centre of mass lies half its length below its pin; its inertia about it is m L^2 / 12 across the bar and,
which no motion feels, the least MuJoCo accepts along it.
Source: Greenwood, Principles of Dynamics, 2nd ed., section 6-6.
"""

ACROSS = 1.0 * 0.5**2 / 12


def model(n: int) -> str:
    """The chain of ``n`` bars, each body nested in the one above."""
    opening: list[str] = []
    for i in range(1, n + 1):
        opening += [
            f'<body name="bar_{i}" pos="0 0 {0 if i == 1 else -0.5}">',
            f'<joint name="joint_{i}" type="hinge" axis="0 -1 0"/>',
            f'<inertial pos="0 0 -0.25" mass="1" diaginertia="{ACROSS!r} {ACROSS!r} 1e-15"/>',
        ]
    return "\n".join(
        [
            f'<mujoco model="bar_chain_{n}">',
            '<compiler angle="radian"/>',
            '<option gravity="0 0 -9.81">',
            '<flag constraint="disable" contact="disable" actuation="disable" sensor="disable" spring="disable" damper="disable"/>',
            "</option>",
            "<worldbody>",
            *opening,
            *["</body>"] * n,
            "</worldbody>",
            "</mujoco>",
            "",
        ]
    )
