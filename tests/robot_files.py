"""Robots with every kind of joint and every way of placing a frame."""

EVERYTHING = """
<mujoco>
  <compiler angle="degree" eulerseq="zyx"/>
  <option gravity="1 -2 -9.5"/>
  <default>
    <joint armature="0.05"/>
    <default class="heavy"><joint damping="0.3" armature="0.2" axis="0 1 0"/></default>
  </default>
  <worldbody>
    <frame pos="0.1 0.2 0.3" axisangle="1 2 3 40">
      <body name="base" pos="0.3 0 0.1" euler="20 -30 50" childclass="heavy">
        <joint name="first" pos="0.02 0.03 -0.1" ref="15" stiffness="3" springref="10"/>
        <joint name="second" class="main" type="slide" axis="0.6 0 0.8" ref="0.2"/>
        <inertial pos="0.1 0 0.05" mass="2" fullinertia="0.03 0.04 0.05 0.002 -0.003 0.004"/>
        <body name="bracket" pos="0 0.2 0" quat="0.9 0.1 -0.3 0.2">
          <inertial pos="0 0.1 0" quat="1 2 -1 0.5" mass="0.7" diaginertia="0.01 0.012 0.015"/>
          <body name="ring" pos="0.1 0 0" xyaxes="1 1 0 0 1 0.5">
            <frame zaxis="1 -2 3"><joint name="third" type="ball" pos="0 0 0.1"/></frame>
            <inertial pos="0.05 -0.02 0.1" euler="10 20 30" mass="1.5" diaginertia="0.02 0.03 0.04"/>
            <body name="tip" pos="0 0 0.4" zaxis="0.3 0.2 -1">
              <joint name="fourth" class="heavy" axis="0 0.6 0.8"/>
              <inertial pos="0.1 0.1 0.1" axisangle="0 1 1 77" mass="0.4" diaginertia="0.001 0.002 0.0025"/>
              <site name="end" pos="0.05 0 0.1"/>
            </body>
          </body>
        </body>
      </body>
    </frame>
    <site name="wall" pos="1 1 1"/>
  </worldbody>
  <tendon><spatial name="band" stiffness="20" damping="0.5" springlength="0.3"><site site="wall"/><site site="end"/></spatial></tendon>
</mujoco>
"""


URDF_WITH_EVERYTHING = """
<robot name="everything">
  <link name="world"/>
  <link name="base">
    <inertial>
      <origin xyz="0.1 0.02 0.05" rpy="0.3 -0.2 0.5"/>
      <mass value="2"/>
      <inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.002" ixz="-0.003" iyz="0.004"/>
    </inertial>
  </link>
  <link name="bracket">
    <inertial><origin xyz="0 0.1 0"/><mass value="0.7"/><inertia ixx="0.01" iyy="0.012" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="slider">
    <inertial>
      <origin xyz="0.05 0 0.1" rpy="1 0.4 -2"/>
      <mass value="1.5"/>
      <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="tip">
    <inertial>
      <origin xyz="0.1 0.1 0.1"/>
      <mass value="0.4"/>
      <inertia ixx="0.001" iyy="0.002" izz="0.0025" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="first" type="revolute">
    <origin xyz="0.3 0 0.1" rpy="0.2 -0.3 0.5"/><parent link="world"/><child link="base"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-9" upper="9" effort="9" velocity="9"/><dynamics damping="0.3"/>
  </joint>
  <joint name="weld" type="fixed"><origin xyz="0 0.2 0" rpy="-1 0.5 2"/><parent link="base"/><child link="bracket"/></joint>
  <joint name="second" type="prismatic">
    <origin xyz="0.1 0 0" rpy="0 0.7 0"/><parent link="bracket"/><child link="slider"/><axis xyz="0.28 0 0.96"/>
    <limit lower="-9" upper="9" effort="9" velocity="9"/>
  </joint>
  <joint name="third" type="revolute">
    <origin xyz="0 0 0.4" rpy="0.1 0.2 0.3"/><parent link="slider"/><child link="tip"/><axis xyz="1 0 0"/>
    <limit lower="-9" upper="9" effort="9" velocity="9"/>
  </joint>
</robot>
"""
