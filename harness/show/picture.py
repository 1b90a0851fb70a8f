"""A mechanism as an SVG drawing: joints, links and centres of mass, seen along one direction.

Classes get their looks from the page that holds the drawing (``report/style.css``), so that it follows
a dark scheme.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from operator import itemgetter

import numpy as np

from harness.arrays import Array
from harness.engines import HeldBody, HeldJoint
from harness.files.joint_kinds import JointKind
from harness.report.figures import COLOURS
from harness.report.html import asset
from harness.show.drawing import Drawing
from harness.show.placement import WORLD, Point, Pose, View

WIDTH = 460.0
_LEAST_HEIGHT, _MOST_HEIGHT = 260.0, 460.0
_MARGIN = 62.0
# Axes, gravity and scale stand below the drawing.
_FOOT = 40.0
# Beyond this number of bodies their names are left out and the symbols are smaller, so as not to cover each other.
_MANY = 8


def draw(placement: Pose, others: Sequence[Pose], view: View, gravity: float, ghost: Pose | None = None) -> str:
    """One ``<svg>`` element of ``placement``, over a shadow of ``ghost``, at the scale that holds ``others`` too."""
    sheet = _Sheet(view, [point for shown in (placement, *others) for point in shown.points()])
    if ghost is not None:
        _Drawing(sheet, ghost).links(shadow=True)
    drawing = _Drawing(sheet, placement)
    for layer in (drawing.ground, drawing.springs, drawing.links, drawing.joints, drawing.centres, drawing.names):
        layer()
    sheet.axes(gravity)
    sheet.scale_bar()
    title = escape(f"Joints {', '.join(placement.joints)}; {view.name}")
    return (
        f'<svg class="mechanism" viewBox="0 0 {WIDTH:g} {sheet.height:g}" role="img" xmlns="http://www.w3.org/2000/svg"><title>{title}</title>'
        + "".join(sheet.parts)
        + "</svg>"
    )


def standing_alone(drawn: str, title: str) -> Drawing:
    """A drawing of ``draw`` with the looks that a page of the report gives it."""
    rules = "\n".join(line for line in asset("style.css").splitlines() if line.startswith("svg.mechanism"))
    return Drawing.styled(drawn, "mechanism", rules, title)


@dataclass
class _Sheet:
    """Drawing parts gathered one after the other; later ones lie on top."""

    view: View
    shown: Sequence[Array]
    parts: list[str] = field(default_factory=list)
    taken: list[tuple[float, float, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        flat = np.array([self.view.flat(point) for point in self.shown])
        low, high = flat.min(axis=0), flat.max(axis=0)
        spans = np.maximum(high - low, 1e-12 + 0.15 * float(np.max(high - low)))
        room = np.array([WIDTH, _MOST_HEIGHT - _FOOT]) - 2 * _MARGIN
        self.scale = float(min(room / spans)) if np.max(high - low) > 0 else 100.0
        self.height = max(_LEAST_HEIGHT, min(_MOST_HEIGHT, self.scale * spans[1] + 2 * _MARGIN + _FOOT))
        self.middle = (low + high) / 2

    def at(self, point: Array) -> Point:
        """Place on the sheet of a point of the world."""
        x, y = self.view.flat(point)
        return WIDTH / 2 + self.scale * (x - self.middle[0]), (self.height - _FOOT) / 2 - self.scale * (y - self.middle[1])

    def along(self, axis: Array) -> Point:
        """A unit axis on the sheet, foreshortened."""
        x, y = self.view.flat(axis)
        return x, -y

    def line(self, points: Sequence[Point], kind: str, colour: str = "") -> None:
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        self.parts.append(f'<path class="{kind}" d="{path}"{_coloured(colour)}/>')

    def circle(self, centre: Point, radius: float, kind: str, colour: str = "", title: str = "") -> None:
        inner = f"<title>{escape(title)}</title>" if title else ""
        place = f'cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{radius:.1f}"'
        self.parts.append(f'<circle class="{kind}" {place}{_coloured(colour)}>{inner}</circle>')

    def take(self, ends: Sequence[Point]) -> None:
        """Keep labels off a line."""
        for t in np.linspace(0, 1, 2 + int(math.dist(*ends) / 8)):
            x, y = (start + t * (end - start) for start, end in zip(*ends, strict=True))
            self.taken.append((x - 4, y - 4, x + 4, y + 4))

    def arrow(self, start: Point, end: Point, kind: str, colour: str = "") -> None:
        length = math.dist(start, end)
        x, y = (end[0] - start[0]) / length, (end[1] - start[1]) / length
        head = [(end[0] - 6 * x - side * 3.5 * y, end[1] - 6 * y + side * 3.5 * x) for side in (1, -1)]
        self.line([start, end], kind, colour)
        self.line([head[0], end, head[1]], kind, colour)

    def label(self, text: str, place: Point, kind: str) -> None:
        """Text near a point, at the first place around it where nothing stands yet."""
        width, height = 6.6 * len(text) + 2, 14.0
        boxes: list[tuple[float, tuple[float, float, float, float]]] = []
        for distance, angle in itertools.product((14, 20, 28, 38, 50, 64, 80), (0, 180, -30, 30, 150, 210, 90, -90)):
            to_right = math.cos(math.radians(angle))
            x, y = place[0] + distance * to_right, place[1] + distance * math.sin(math.radians(angle))
            left = x if to_right > 0.1 else x - width if to_right < -0.1 else x - width / 2
            box = (left, y - height / 2, left + width, y + height / 2)
            inside = box[0] > 2 and box[2] < WIDTH - 2 and box[1] > 2 and box[3] < self.height - 48
            boxes.append((sum(_overlap(box, other) for other in self.taken) + (0 if inside else 1e6) + distance, box))
        _, best = min(boxes, key=itemgetter(0))
        self.taken.append(best)
        self.parts.append(f'<text class="{kind}" x="{best[0]:.1f}" y="{best[3] - 3.5:.1f}">{escape(text)}</text>')

    def axes(self, gravity: float) -> None:
        """The world's axes and gravity, in the lower left corner."""
        corner = (46.0, self.height - 34)
        for name, axis in zip("xyz", np.eye(3), strict=True):
            self._direction(corner, axis, 26, name, "axes")
        if gravity:
            self._direction((110.0, self.height - 46), np.array([0.0, 0.0, -1.0]), 26, "g", "gravity")

    def _direction(self, start: Point, axis: Array, length: float, name: str, kind: str) -> None:
        """An arrow; a circle with a dot where it points at the viewer, with a cross where it points away."""
        x, y = self.along(axis)
        if math.hypot(x, y) > 0.2:
            end = (start[0] + length * x, start[1] + length * y)
            self.arrow(start, end, kind)
            place = (end[0] + 8 * x / math.hypot(x, y) - 3, end[1] + 9 * y / math.hypot(x, y) + 4)
        else:
            self.circle(start, 5, kind)
            if float(np.dot(axis, self.view.towards)) > 0:
                self.circle(start, 1.5, kind)
            else:
                for side in (3.5, -3.5):
                    self.line([(start[0] - 3.5, start[1] - side), (start[0] + 3.5, start[1] + side)], kind)
            place = (start[0] - 15, start[1] + 13)
        self.parts.append(f'<text class="{kind}" x="{place[0]:.1f}" y="{place[1]:.1f}">{escape(name)}</text>')

    def scale_bar(self) -> None:
        """A length of 1, 2 or 5 times a power of ten, in the lower right corner."""
        longest = 100 / self.scale
        power = 10.0 ** math.floor(math.log10(longest))
        length = next(step * power for step in (5, 2, 1) if step * power <= longest)
        right, y = WIDTH - 20, self.height - 22
        left = right - length * self.scale
        self.line([(left, y - 4), (left, y), (right, y), (right, y - 4)], "axes")
        self.parts.append(f'<text class="axes" text-anchor="end" x="{right:.1f}" y="{y - 9:.1f}">{length:g} m</text>')


@dataclass
class _Drawing:
    """One pose on a sheet; ``tips`` are the ends of its joints' symbols, by which their names stand."""

    sheet: _Sheet
    pose: Pose
    tips: dict[str, Point] = field(default_factory=dict)

    def links(self, shadow: bool = False) -> None:
        """Each body as lines from its last joint to its centre of mass and to the joints it carries."""
        for number, body in enumerate(self.pose.bodies):
            hub = _joints_of(self.pose, number)[-1].moved
            ends = [_joints_of(self.pose, child)[0].anchor for child, parent in enumerate(self.pose.parents) if parent == number]
            ends += [body.centre] if _is_heavy(self.pose, number) else []
            for end in ends:
                if math.dist(self.sheet.at(hub), self.sheet.at(end)) > 0.5:
                    self.sheet.line(
                        [self.sheet.at(hub), self.sheet.at(end)], "shadow" if shadow else "link", "" if shadow else _colour(number)
                    )
                    if not shadow:
                        self.sheet.take([self.sheet.at(hub), self.sheet.at(end)])
        for name, joint in self.pose.joints.items():
            if not shadow and joint.kind is JointKind.SLIDE and math.dist(self.sheet.at(joint.anchor), self.sheet.at(joint.moved)) > 0.5:
                self.sheet.line([self.sheet.at(joint.anchor), self.sheet.at(joint.moved)], "rail", _colour(self.pose.body_of[name]))

    def ground(self) -> None:
        """Hatching under the joints that stand on the world."""
        first = [_joints_of(self.pose, number)[0] for number, parent in enumerate(self.pose.parents) if parent == WORLD]
        # In the order of the joints: that of a set of floats hangs on their last bits, which machines differ in.
        for x, y in dict.fromkeys(self.sheet.at(joint.anchor) for joint in first if joint.kind is not JointKind.FREE):
            self.sheet.line([(x - 16, y + 11), (x + 16, y + 11)], "ground")
            self.sheet.taken.append((x - 18, y, x + 18, y + 18))
            for step in range(-14, 17, 6):
                self.sheet.line([(x + step, y + 11), (x + step - 5, y + 17)], "ground")
            self.sheet.line([(x, y), (x - 8, y + 11), (x + 8, y + 11), (x, y)], "ground")

    def springs(self) -> None:
        for spring in self.pose.springs:
            for start, end in zip(map(self.sheet.at, spring), map(self.sheet.at, spring[1:]), strict=False):
                length = math.dist(start, end) or 1.0
                x, y = (end[0] - start[0]) / length, (end[1] - start[1]) / length
                turns = max(4, int(length / 22))
                bends = [(start[0] + x * length * t, start[1] + y * length * t) for t in np.linspace(0.1, 0.9, 2 * turns)]
                sides = [(bx - y * 6 * (-1) ** n, by + x * 6 * (-1) ** n) for n, (bx, by) in enumerate(bends)]
                self.sheet.line([start, *sides, end], "spring")
                self.sheet.take([start, end])

    def joints(self) -> None:
        """Hinges as circles or as capsules along their axis, slides as bars; the arrow shows the positive sense.

        Of joints in one place the outer ones are drawn larger, and the inner ones over them.
        """
        small = _symbol_size(self.pose)
        places = [tuple(map(round, self.sheet.at(joint.moved))) for joint in self.pose.joints.values()]
        for number, (name, joint) in enumerate(self.pose.joints.items()):
            inside = 1.0 * places[number + 1 :].count(places[number])
            # A ring round the centre of mass that would hide it.
            inside += 1.5 * any(
                math.dist(self.sheet.at(body.centre), self.sheet.at(joint.moved)) < 3 for body in self.pose.bodies if body.mass > 0
            )
            colour = _colour(self.pose.body_of[name])
            self._joint(name, joint, colour, small * (16.0 + 10.0 * inside), small * (6.0 + 4.0 * inside))

    def _joint(self, name: str, joint: HeldJoint, colour: str, size: float, radius: float) -> None:
        place = tip = self.sheet.at(joint.moved)
        axis = self.sheet.along(joint.axis)
        seen = math.hypot(*axis)
        if not JointKind(joint.kind).is_single:
            self.sheet.circle(place, radius + 2, "joint", colour, f"{name}, {joint.kind}")
            self.sheet.circle(place, 3, "dot", colour)
        elif joint.kind == JointKind.HINGE and seen < 0.2:
            self._turning(name, joint, radius, colour)
        elif seen < 0.2:
            self.sheet.line([(place[0] + dx, place[1] + dy) for dx, dy in ((-7, -7), (7, -7), (7, 7), (-7, 7), (-7, -7))], "joint", colour)
        else:
            tail, end = ((place[0] + sign * size * axis[0], place[1] + sign * size * axis[1]) for sign in (-1, 1))
            tip = (place[0] + (size + 18) * axis[0] / seen, place[1] + (size + 18) * axis[1] / seen)
            for kind in ("capsule-edge", "capsule") if joint.kind == JointKind.HINGE else ("bar",):
                self.sheet.line([tail, end], kind, colour if kind != "capsule" else "")
            self.sheet.arrow(end, tip, "sense", colour)
            self.sheet.take([tail, tip])
        self.tips[name] = tip
        self.sheet.taken.append((place[0] - 9, place[1] - 9, place[0] + 9, place[1] + 9))

    def _turning(self, name: str, joint: HeldJoint, radius: float, colour: str) -> None:
        """A hinge seen along its axis, with the arrow of positive angles."""
        place = self.sheet.at(joint.moved)
        self.sheet.circle(place, radius, "joint", colour, f"{name}, hinge")
        # Downwards on the sheet is a right-handed turn about an axis that points away.
        sweep = [math.radians(angle) for angle in range(-70, 31, 20)]
        if float(np.dot(joint.axis, self.sheet.view.towards)) > 0:
            sweep = [-angle for angle in sweep]
        path = [(place[0] + (radius + 8) * math.cos(a), place[1] + (radius + 8) * math.sin(a)) for a in sweep]
        self.sheet.line(path[:-1], "sense", colour)
        self.sheet.arrow(path[-2], path[-1], "sense", colour)
        self.sheet.taken.append((place[0], place[1] - radius - 10, place[0] + radius + 12, place[1] + radius + 10))

    def centres(self) -> None:
        """Quartered circles, larger for heavier bodies."""
        heaviest = max((body.mass for body in self.pose.bodies), default=0.0)
        for number, body in enumerate(self.pose.bodies):
            if _is_heavy(self.pose, number):
                (x, y), r = self.sheet.at(body.centre), _symbol_size(self.pose) * (4.5 + 4 * (body.mass / heaviest) ** (1 / 3))
                self.sheet.circle((x, y), r, "centre", _colour(number), _title(body, number))
                quarters = (
                    f"M{x:.1f} {y:.1f}v{-r:.1f}a{r:.1f} {r:.1f} 0 0 1 {r:.1f} {r:.1f}zv{r:.1f}a{r:.1f} {r:.1f} 0 0 1 {-r:.1f} {-r:.1f}z"
                )
                self.sheet.parts.append(f'<path class="quarters" d="{quarters}"{_coloured(_colour(number), "fill")}/>')
                self.sheet.taken.append((x - r, y - r, x + r, y + r))

    def names(self) -> None:
        for joint in self.pose.body_of:
            self.sheet.label(joint, self.tips[joint], "name")
        for number, body in enumerate(self.pose.bodies):
            if _is_heavy(self.pose, number) and len(self.pose.bodies) <= _MANY:
                self.sheet.label(_title(body, number), self.sheet.at(body.centre), "name body")


def _joints_of(placement: Pose, body: int) -> list[HeldJoint]:
    return [joint for name, joint in placement.joints.items() if placement.body_of[name] == body]


def _title(body: HeldBody, number: int) -> str:
    return f"{body.name or f'body {number + 1}'}, {body.mass:g} kg"


def _is_heavy(placement: Pose, body: int) -> bool:
    # Below this a mass is only there because some reader wants one.
    return placement.bodies[body].mass > 1e-9 * sum(other.mass for other in placement.bodies)


def _symbol_size(placement: Pose) -> float:
    return 1.0 if len(placement.bodies) <= _MANY else 0.6


def _colour(body: int) -> str:
    return COLOURS[body % len(COLOURS)]


def _coloured(colour: str, attribute: str = "stroke") -> str:
    return f' style="{attribute}:{colour}"' if colour else ""


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> float:
    width, height = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return width * height if width > 0 and height > 0 else 0.0
