"""URDF of N four-bars in a row, the IFToMM benchmark A02: bars of 1 kg and 1 m, which Drake's ball constraints close into loops.

Each link's frame is the pin that it hangs on, with x along the bar and the centre of mass at 0.5 m. Cranks stand at x = 0, 1, ..., N
and have m L^2 / 12 = 0.08333333333333333 kg m^2 about y and z; couplers only translate, and have no inertia.
"""

LINK = """
  <link name="{name}">
    <inertial>
      <origin xyz="0.5 0 0"/>
      <mass value="1"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/>
    </inertial>
  </link>
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/>
    <child link="{name}"/>{pin}
    <axis xyz="0 -1 0"/>
    <limit effort="0" velocity="0"/>
  </joint>"""

PIN = '\n    <origin xyz="{x} 0 0"/>'

CLOSURE = """
  <drake:ball_constraint name="closure_{i}">
    <drake:ball_constraint_body_A name="coupler_{i}"/>
    <drake:ball_constraint_p_AP value="1 0 0"/>
    <drake:ball_constraint_body_B name="crank_{i}"/>
    <drake:ball_constraint_p_BQ value="1 0 0"/>
  </drake:ball_constraint>"""


def model(n: int) -> str:
    """``n`` four-bars."""
    parts = [
        LINK.format(name=f"crank_{i}", parent="world", pin=PIN.format(x=i) if i else "", inertia="0.08333333333333333")
        for i in range(n + 1)
    ]
    for i in range(1, n + 1):
        parts.append(LINK.format(name=f"coupler_{i}", parent=f"crank_{i - 1}", pin=PIN.format(x=1), inertia="0"))
        parts.append(CLOSURE.format(i=i))
    return f'<robot name="four_bar_chain_{n}" xmlns:drake="http://drake.mit.edu">\n  <link name="world"/>' + "".join(parts) + "\n</robot>\n"
