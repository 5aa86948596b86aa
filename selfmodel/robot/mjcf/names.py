"""Gives the parts of an MJCF names, without the special characters of notation."""

import re
from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET  # of checked texts

from selfmodel.robot.mjcf.document import Document

_SPECIAL_CHARACTERS = re.compile(r"[^\w.-]")
_JOINT_TAGS = ("joint", "freejoint")

_REFERENCES: Mapping[str, tuple[str, ...]] = {
    "body": ("body", "body1", "body2", "subtree1", "subtree2", "target"),
    "joint": ("joint", "joint1", "joint2", "jointinparent"),
    "actuator": ("actuator",),
    "sensor": (),
}
"""Attributes that contain the name of a part, by kind of part. ``objname`` and ``refname`` are not
included: ``objtype`` and ``reftype`` contain their kind."""


class UniqueNames:
    """Unique names for the parts of one kind.

    Args:
        names: Names in use.
    """

    def __init__(self, names: Iterable[str | None]) -> None:
        self._names = {name for name in names if name}
        self._numbers: dict[str, int] = {}

    def new(self, base: str) -> str:
        """Returns the base name, with a number appended if the name is in use."""
        name, number = base, self._numbers.get(base, 2)
        while name in self._names:
            name, number = f"{base}_{number}", number + 1
        self._names.add(name)
        self._numbers[base] = number
        return name


def name_parts(document: Document) -> None:
    """Gives each body, joint, actuator and sensor a unique name.

    A body without a name gets the name of its first joint, a joint that of its body, an actuator
    that of its joint or tendon, a sensor that of its joint or its type. Special characters of
    notation become ``_``, also in references.

    Args:
        document: The MJCF, edited in place.
    """
    bodies = document.bodies()
    joints = [(body, joint) for body in bodies for joint in body if joint.tag in _JOINT_TAGS]
    actuators = document.children("actuator")
    sensors = document.children("sensor")
    parts = {
        "body": bodies,
        "joint": [joint for _, joint in joints],
        "actuator": actuators,
        "sensor": sensors,
    }
    for kind, elements in parts.items():
        _replace_special_characters(document, kind, elements)
    original = {kind: [e.get("name") for e in elements] for kind, elements in parts.items()}
    names = UniqueNames(original["body"])
    for number, body in enumerate(bodies, 1):
        first = next((j.get("name") for j in body if j.tag == "joint" and j.get("name")), None)
        _set_name(body, names, first or f"body_{number}")
    names = UniqueNames(original["joint"])
    for body, joint in joints:
        body_name = str(body.get("name"))
        _set_name(joint, names, f"{body_name}_root" if joint.tag == "freejoint" else body_name)
    names = UniqueNames(original["actuator"])
    for motor in actuators:
        driven = motor.get("joint") or motor.get("jointinparent") or motor.get("tendon")
        _set_name(motor, names, _SPECIAL_CHARACTERS.sub("_", driven) if driven else "motor")
    names = UniqueNames(original["sensor"])
    for sensor in sensors:
        base = f"{sensor.get('joint')}_angle" if sensor.tag == "jointpos" else sensor.tag
        _set_name(sensor, names, base)
    unnamed = sum(n is None for kind in ("body", "joint", "actuator") for n in original[kind])
    if unnamed:
        document.notes.append(f"{unnamed} parts without a name got one")


def _set_name(element: ET.Element, names: UniqueNames, base: str) -> None:
    """Gives an element a name if it has none."""
    if not element.get("name"):
        element.set("name", names.new(base))


def _replace_special_characters(document: Document, kind: str, elements: list[ET.Element]) -> None:
    special = [
        name for e in elements if (name := e.get("name")) and _SPECIAL_CHARACTERS.search(name)
    ]
    names = UniqueNames(e.get("name") for e in elements)
    new = {name: names.new(_SPECIAL_CHARACTERS.sub("_", name)) for name in dict.fromkeys(special)}
    _rename(document, kind, elements, new)
    for old, name in new.items():
        document.notes.append(f"the {kind} {old!r} is renamed to {name}")


def _rename(
    document: Document, kind: str, elements: list[ET.Element], new: Mapping[str, str]
) -> None:
    """Renames parts of one kind, and the references to them."""
    if not new:
        return
    for element in elements:
        if element.get("name") in new:
            element.set("name", new[str(element.get("name"))])
    for element in document.root.iter():
        for attribute in _REFERENCES[kind]:
            if element.get(attribute) in new:
                element.set(attribute, new[str(element.get(attribute))])
        for prefix in ("obj", "ref"):
            target_kind = element.get(f"{prefix}type", "").removeprefix("x")
            if target_kind == kind and element.get(f"{prefix}name") in new:
                element.set(f"{prefix}name", new[str(element.get(f"{prefix}name"))])
