"""URDF of the n-bar pendulum of Greenwood, Principles of Dynamics, 2nd ed., section 6-6.

Bars of 1 kg and 0.5 m hang one below the other; each link's frame is its upper pin, the centre of mass a quarter
of a metre below it, the central inertia m L^2 / 12 about x and y.
"""

ACROSS = 1.0 * 0.5**2 / 12
BAR = """
  <link name="link_{i}">
    <inertial>
      <origin xyz="0 0 -0.25"/>
      <mass value="1"/>
      <inertia ixx="{across!r}" ixy="0" ixz="0" iyy="{across!r}" iyz="0" izz="0"/>
    </inertial>
  </link>
  <joint name="joint_{i}" type="revolute">
    <parent link="{above}"/>
    <child link="link_{i}"/>
    <origin xyz="0 0 {down}"/>
    <axis xyz="0 -1 0"/>
    <limit effort="0" velocity="0"/>
  </joint>"""


def model(n: int) -> str:
    """The pendulum of ``n`` bars."""
    bars = [BAR.format(i=i, above=f"link_{i - 1}" if i > 1 else "world", down=-0.5 if i > 1 else 0, across=ACROSS) for i in range(1, n + 1)]
    return f'<robot name="bar_chain_{n}">\n  <link name="world"/>' + "".join(bars) + "\n</robot>\n"
