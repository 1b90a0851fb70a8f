"""What acts in MuJoCo while constraints, actuators and contacts are off, and no tree of rigid bodies holds.

Deformable bodies and plugins are computed among the passive forces. The armature and the damping of an actuator are added to its joint or
tendon, gear^2 times, with actuation off too.

Source: MuJoCo documentation, XML reference, ``deformable/flex``, ``extension/plugin``, ``actuator/general``; MuJoCo 4.0.0.
"""

from __future__ import annotations

from collections.abc import Iterator

from harness.files.document.source import Source, Unread
from harness.files.document.xml import describe
from harness.files.mjcf.attributes import Attributes

# Plugins of MuJoCo that act as actuators, sensors and shapes of contacts alone.
_OFF_WITH_STAGES = ("mujoco.pid", "mujoco.sensor.", "mujoco.sdf.")
_WITHOUT_IT = "compare a copy without it"
_TO_THE_TARGET = "write gear^2 times that into its joint or tendon"


def note_what_is_always_on(source: Source, attributes: Attributes) -> None:
    """Add to ``source.unread`` what the file states of this kind.

    Raises:
        InvalidModel: a number of it is none.
    """
    source.unread.extend(_of_flexes(source, attributes))
    source.unread.extend(_of_plugins(source))
    for actuator in source.root.iterfind("actuator/*"):
        if armature := attributes.number(actuator, "armature", 0.0):
            attributes.leave_unread(actuator, "armature", armature, "is an inertia that stays on with actuators off", _TO_THE_TARGET)
        damping = next(filter(None, attributes.numbers(actuator, "damping", (0, 0, 0))), None)
        if damping is not None and attributes.acts("damper"):
            attributes.leave_unread(actuator, "damping", damping, "is a damper that stays on with actuators off", _TO_THE_TARGET)


def _of_flexes(source: Source, attributes: Attributes) -> Iterator[Unread]:
    springs, dampers = attributes.acts("spring"), attributes.acts("damper")
    for flex in source.root.iterfind("deformable/flex"):
        numbers = (("edge", "stiffness", springs), ("edge", "damping", dampers), ("elasticity", "young", springs or dampers))
        for part, name, acts in numbers:
            element = flex.find(part)
            # A surface is neither stretched nor bent unless elastic2d says so.
            is_limp = part == "elasticity" and flex.get("dim", "2") == "2" and flex.xpath("string(elasticity/@elastic2d)") in ("", "none")
            if element is not None and acts and not is_limp and source.number(element, name, 0.0):
                what = f'<{part} {name}="{element.get(name)}"> of {describe(flex)} is a passive force that stays on with constraints off'
                yield Unread(source.place(element), what, _WITHOUT_IT)
                break


def _of_plugins(source: Source) -> Iterator[Unread]:
    """Of what has a plugin first: an instance in <extension> may act without."""
    declared = {
        instance.get("name"): str(plugin.get("plugin"))
        for plugin in source.root.iterfind("extension/plugin")
        for instance in plugin.iterchildren("instance")
    }
    users = [plugin for plugin in source.root.iter("plugin") if plugin.getparent().tag != "extension"]
    for plugin in (*users, *(one for one in source.root.iterfind("extension/plugin") if one.find("instance") is not None)):
        name = plugin.get("plugin") or declared.get(plugin.get("instance"), "")
        if not name.startswith(_OFF_WITH_STAGES):
            what = f"plugin {name!r} in {describe(plugin.getparent())} is code that may push bodies with constraints and actuators off"
            yield Unread(source.place(plugin), what, _WITHOUT_IT)
