"""Three robots whose motions drift apart, and gaps that are planted in their files."""

from __future__ import annotations

import re
from collections.abc import Collection

from harness.results.cause import DriftCause

# Six axes as an arm of 12 kg has them, with a servo each: kp 100, kv 5.13, at most 3.5 N m in the last ones.
_AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")


def _arm() -> str:
    bodies, ends, place = "", "", "0 0 0.15"
    for number, axis in enumerate(_AXES):
        mass = 4.0 - 0.6 * number
        bodies += f"""
<body name="link{number}" pos="{place}">
  <joint name="joint{number}" axis="{axis}" range="-1.2 1.2" damping="0.4" armature="0.05" frictionloss="0.3"/>
  <inertial pos="0.01 0.02 0.1" mass="{mass:g}" diaginertia="{0.02 * mass:g} {0.018 * mass:g} {0.006 * mass:g}"/>"""
        ends, place = ends + "</body>", "0 0 0.2"
    servos = "\n".join(
        f'<position name="servo{number}" joint="joint{number}" kp="60" kv="5.13" gear="1" forcerange="-3.5 3.5" ctrlrange="-3 3"/>'
        for number in range(len(_AXES))
    )
    return f"""<mujoco model="arm">
<compiler angle="radian"/>
<option timestep="0.002" integrator="implicitfast"/>
<worldbody>{bodies}{ends}
</worldbody>
<actuator>
{servos}
</actuator>
<keyframe><key qpos="0.1 -0.2 0.3 0.1 -0.1 0.2" ctrl="0.9 0.5 -0.6 0.8 0.7 -0.9"/></keyframe>
</mujoco>
"""


ARM = _arm()
# A leg on a rail that drops onto the floor, driven by motors with gears.
HOPPER = """<mujoco model="hopper">
<compiler angle="radian"/>
<option timestep="0.002"/>
<worldbody>
  <geom name="floor" type="plane" size="5 5 0.1" solref="0.02 1" friction="0.8 0.01 0.001"/>
  <body name="trunk" pos="0 0 0.72">
    <joint name="rail" type="slide" axis="0 0 1" damping="1"/>
    <inertial pos="0 0 0" mass="3" diaginertia="0.02 0.02 0.02"/>
    <body name="thigh">
      <joint name="hip" axis="0 1 0" range="-1 0.35" damping="0.2" armature="0.02" frictionloss="0.2"/>
      <inertial pos="0 0 -0.15" mass="0.8" diaginertia="0.006 0.006 0.001"/>
      <body name="shank" pos="0 0 -0.35">
        <joint name="knee" axis="0 1 0" range="-2 -0.2" damping="0.2" armature="0.02" frictionloss="0.2"/>
        <inertial pos="0 0 -0.15" mass="0.4" diaginertia="0.003 0.003 0.0005"/>
        <geom name="foot" type="sphere" size="0.03" pos="0 0 -0.35" solref="0.02 1" friction="0.8 0.01 0.001"/>
      </body>
    </body>
  </body>
</worldbody>
<actuator>
  <general name="hip_drive" joint="hip" gear="2" gainprm="20" biastype="affine" biasprm="0 -20 -0.6" forcerange="-4 4"/>
  <position name="knee_drive" joint="knee" gear="2" kp="20" kv="0.6" forcerange="-4 4"/>
</actuator>
<keyframe><key qpos="0 0.3 -0.7" ctrl="0.9 -1.2"/></keyframe>
</mujoco>
"""
# A cart with a pole that strikes its limits, and a ball joint below.
CART = """<mujoco model="cart">
<compiler angle="radian"/>
<option timestep="0.004" integrator="RK4"/>
<worldbody>
  <body name="cart">
    <joint name="rail" type="slide" axis="1 0 0" range="-0.3 0.12" damping="2" frictionloss="1.5" armature="0.3"/>
    <inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
    <body name="pole">
      <joint name="pin" axis="0 1 0" range="-0.7 0.9" damping="0.05" armature="0.01" frictionloss="0.1"/>
      <inertial pos="0 0 -0.3" mass="0.7" diaginertia="0.01 0.01 0.001"/>
      <body name="bob" pos="0 0 -0.6">
        <joint name="swivel" type="ball" damping="0.01"/>
        <inertial pos="0.02 0 -0.1" mass="0.3" diaginertia="0.002 0.002 0.001"/>
      </body>
    </body>
  </body>
</worldbody>
<actuator>
  <velocity name="drive" joint="rail" kv="12" gear="1.5" forcerange="-14 14"/>
  <motor name="twist" joint="pin" gear="1.2" ctrlrange="-2 2"/>
</actuator>
<keyframe><key qpos="0 0.3 1 0 0 0" ctrl="0.8 1.5"/></keyframe>
</mujoco>
"""
ROBOTS = {"arm": ARM, "hopper": HOPPER, "cart": CART}
# Attributes of all robots that are planted: the cause, and the pattern of a number with what it is multiplied by.
SCALED = {
    DriftCause.GAIN: (r'kp="([\d.]+)"|gainprm="([\d.]+)"', 0.6),
    DriftCause.DERIVATIVE_GAIN: (r'kv="([\d.]+)"|biasprm="0 -20 (-[\d.]+)"', 0.3),
    DriftCause.GEAR: (r'gear="([\d.]+)"', 0.7),
    DriftCause.ARMATURE: (r'armature="([\d.]+)"', 6.0),
    DriftCause.DAMPING: (r'damping="([\d.]+)"', 4.0),
    DriftCause.FRICTION: (r'frictionloss="([\d.]+)"', 5.0),
    DriftCause.LIMITS: (r' range="(-?[\d.]+) (-?[\d.]+)"', 0.3),
    DriftCause.FORCE_RANGE: (r'forcerange="(-[\d.]+) ([\d.]+)"', 0.4),
    DriftCause.STEP: (r'timestep="([\d.]+)"', 4.0),
    DriftCause.CONTACT_LAW: (r'solref="([\d.]+) 1"', 4.0),
}
# A change of each that is there beside the planted one; and beside two, of which one may be felt a ten-thousandth as much as the other,
# as another implicit integrator is beside a force range of 40 %.
SMALL, SMALLEST = 1.001, 1.000001
INTEGRATORS = {"arm": ('integrator="implicitfast"', 'integrator="Euler"'), "hopper": ("<option ", '<option integrator="RK4" ')}
INTEGRATORS["cart"] = ('integrator="RK4"', 'integrator="Euler"')


def scaled(text: str, cause: DriftCause, factor: float) -> str:
    """A file with all numbers of a cause multiplied; raises AssertionError where it has none."""
    pattern, _ = SCALED[cause]

    def multiply(match: re.Match[str]) -> str:
        found, start = match.group(), match.start()
        for group in range(len(match.groups()), 0, -1):
            if match.group(group) is not None:
                begin, end = match.start(group) - start, match.end(group) - start
                found = found[:begin] + repr(float(match.group(group)) * factor) + found[end:]
        return found

    changed, count = re.subn(pattern, multiply, text)
    assert count, f"nothing to plant of {cause}"
    return changed


def planted(robot: str, causes: Collection[DriftCause], small: Collection[DriftCause] = (), by: float = SMALL) -> str:
    """The file of a robot with large changes of some causes and small ones of others, as far as it has those."""
    text = ROBOTS[robot]
    for cause in causes:
        if cause == DriftCause.INTEGRATOR:
            assert INTEGRATORS[robot][0] in text
            text = text.replace(*INTEGRATORS[robot], 1)
        elif cause != DriftCause.DELAY:
            text = scaled(text, cause, SCALED[cause][1])
    for cause in small:
        if cause not in causes and re.search(SCALED[cause][0], text):
            text = scaled(text, cause, by)
    return text
