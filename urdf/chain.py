"""URDF of the n-bar pendulum of Greenwood, Principles of Dynamics, 2nd ed., section 6-6.

Bars of 1.5 kg and 0.5 m hang one below the other; each link's frame is its upper pin, the centre of mass
a quarter of a metre below it, the central inertia m L^2 / 12 = 0.03125 kg m^2 about x and y.
"""

BAR = """
  <link name="link_{i}">
    <inertial>
      <origin xyz="0 0 -0.25"/>
      <mass value="1.5"/>
      <inertia ixx="0.03125" ixy="0" ixz="0" iyy="0.03125" iyz="0" izz="0"/>
    </inertial>
  </link>
  <joint name="joint_{i}" type="revolute">
    <parent link="{above}"/>
    <child link="link_{i}"/>{pin}
    <axis xyz="0 -1 0"/>
    <limit effort="0" velocity="0"/>
  </joint>"""


def model(n: int) -> str:
    """The pendulum of ``n`` bars."""
    bars = [BAR.format(i=1, above="world", pin="")]
    for i in range(2, n + 1):
        bars.append(BAR.format(i=i, above=f"link_{i - 1}", pin='\n    <origin xyz="0 0 -0.5"/>'))
    return f'<robot name="chain_{n}">\n  <link name="world"/>' + "".join(bars) + "\n</robot>\n"
