"""MJCF of the row of n four-bars: uniform bars of 1 kg and 1 m, n + 1 cranks on the ground and n couplers between their ends.

A bar's centre of mass is half its length from its pin. A crank's inertia about it is m L^2 / 12 = 0.08333333333333333 kg m^2 across
the bar; that along it, and those of the couplers, which only translate, are felt by no motion: they are the least MuJoCo accepts.
The ground is a body, since Pinocchio reads the first body of the world only.
Source: IFToMM library of computational benchmark problems, A02.
"""

CRANK = """
<body name="crank_{i}"{place}>
<joint name="crank_{i}" type="hinge" axis="0 -1 0"/>
<inertial pos="0.5 0 0" mass="1" diaginertia="1e-15 0.08333333333333333 0.08333333333333333"/>{end}{coupler}
</body>"""

COUPLER = """
<body name="coupler_{i}" pos="1 0 0">
<joint name="coupler_{i}" type="hinge" axis="0 -1 0"/>
<inertial pos="0.5 0 0" mass="1" diaginertia="1e-15 1e-15 1e-15"/>
<site name="coupler_{i}_end" pos="1 0 0"/>
</body>"""


def model(n: int) -> str:
    """The row of ``n`` four-bars: each crank but the last carries a coupler, whose end a connect holds at the next crank's."""
    cranks = "".join(
        CRANK.format(
            i=i,
            place=f' pos="{i} 0 0"' if i else "",
            end=f'\n<site name="crank_{i}_end" pos="1 0 0"/>' if i else "",
            coupler=COUPLER.format(i=i + 1) if i < n else "",
        )
        for i in range(n + 1)
    )
    closures = "".join(f'\n<connect name="closure_{i}" site1="coupler_{i}_end" site2="crank_{i}_end"/>' for i in range(1, n + 1))
    return f"""<mujoco model="four_bar_chain_{n}">
<compiler angle="radian"/>
<option gravity="0 0 -9.81">
<flag contact="disable" actuation="disable" sensor="disable" spring="disable" damper="disable"/>
</option>
<worldbody>
<body name="ground">{cranks}
</body>
</worldbody>
<equality>{closures}
</equality>
</mujoco>
"""
