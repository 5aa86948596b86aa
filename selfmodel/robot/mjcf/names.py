"""Names for what has none, and names that notation and logs can carry."""

import re
from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET  # of texts that were checked

from selfmodel.robot.mjcf.document import Document

_UNUSUAL = re.compile(r"[^\w.-]")
_HINGE_TAGS = ("joint", "freejoint")

_REFERENCES: Mapping[str, tuple[str, ...]] = {
    "body": ("body", "body1", "body2", "subtree1", "subtree2", "target"),
    "joint": ("joint", "joint1", "joint2", "jointinparent"),
    "actuator": ("actuator",),
    "sensor": (),
}
"""By kind of part, the attributes that name one. ``objname`` and ``refname`` say the kind."""


class Taken:
    """The names of one kind of part, each once.

    Args:
        names: Those that are given away already.
    """

    def __init__(self, names: Iterable[str | None]) -> None:
        self._names = {name for name in names if name}

    def new(self, wish: str) -> str:
        """Returns the wished name, with a number behind it where that is given away."""
        name, number = wish, 2
        while name in self._names:
            name, number = f"{wish}_{number}", number + 1
        self._names.add(name)
        return name


def name_parts(document: Document) -> None:
    """Gives bodies, joints, actuators and sensors of touch and of angles a name each.

    A body without a name is called like its first joint, a joint like its body, a motor like what
    it drives. Letters that would mean something in notation become ``_``, wherever the name stands.
    """
    bodies = document.bodies()
    joints = [(body, joint) for body in bodies for joint in body if joint.tag in _HINGE_TAGS]
    actuators = document.children("actuator")
    sensors = document.children("sensor")
    parts = {
        "body": bodies,
        "joint": [joint for _, joint in joints],
        "actuator": actuators,
        "sensor": sensors,
    }
    for kind, elements in parts.items():
        _make_plain(document, kind, elements)
    before = {kind: [e.get("name") for e in elements] for kind, elements in parts.items()}
    taken = Taken(before["body"])
    for number, body in enumerate(bodies, 1):
        first = next((j.get("name") for j in body if j.tag == "joint" and j.get("name")), None)
        _name(body, taken, first or f"body_{number}")
    taken = Taken(before["joint"])
    for body, joint in joints:
        own = str(body.get("name"))
        _name(joint, taken, f"{own}_root" if joint.tag == "freejoint" else own)
    taken = Taken(before["actuator"])
    for motor in actuators:
        drives = motor.get("joint") or motor.get("jointinparent") or motor.get("tendon")
        _name(motor, taken, _UNUSUAL.sub("_", drives) if drives else "motor")
    taken = Taken(before["sensor"])
    for sensor in sensors:
        wish = f"{sensor.get('joint')}_angle" if sensor.tag == "jointpos" else sensor.tag
        _name(sensor, taken, wish)
    named = sum(n is None for kind in ("body", "joint", "actuator") for n in before[kind])
    if named:
        document.notes.append(f"{named} parts without a name were given one")


def _name(element: ET.Element, taken: Taken, wish: str) -> None:
    if not element.get("name"):
        element.set("name", taken.new(wish))


def _make_plain(document: Document, kind: str, elements: list[ET.Element]) -> None:
    odd = [name for e in elements if (name := e.get("name")) and _UNUSUAL.search(name)]
    taken = Taken(e.get("name") for e in elements)
    new = {name: taken.new(_UNUSUAL.sub("_", name)) for name in dict.fromkeys(odd)}
    _rename(document, kind, elements, new)
    for old, name in new.items():
        document.notes.append(f"the {kind} {old!r} is called {name} here")


def _rename(
    document: Document, kind: str, elements: list[ET.Element], new: Mapping[str, str]
) -> None:
    """Renames parts of one kind, and what refers to them."""
    if not new:
        return
    for element in elements:
        if element.get("name") in new:
            element.set("name", new[str(element.get("name"))])
    for element in document.root.iter():
        for attribute in _REFERENCES[kind]:
            if element.get(attribute) in new:
                element.set(attribute, new[str(element.get(attribute))])
        for whose in ("obj", "ref"):
            told = element.get(f"{whose}type", "").removeprefix("x")
            if told == kind and element.get(f"{whose}name") in new:
                element.set(f"{whose}name", new[str(element.get(f"{whose}name"))])
