"""Checks that the links and joints of a URDF form one tree, before MuJoCo reads the URDF."""

from collections import Counter
from collections.abc import Collection
from xml.etree import ElementTree as ET  # of checked texts

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.untrusted import MAX_DEPTH

MAX_LINK_DEPTH = MAX_DEPTH - 10
"""Largest number of links from the root to an end; in MJCF, each link is nested in its parent."""

HINGE_TYPES = ("revolute", "continuous")
JOINT_TYPES = (*HINGE_TYPES, "fixed")

_MAX_QUOTED = 80

_REMEDIES = {
    "prismatic": "a limb's posture is the angles of its hinges, so replace it by a revolute joint "
    'or fix it with type="fixed"',
    "floating": "only the root link moves freely, and gets a free joint without this element: keep "
    "the robot, and remove the other bodies",
    "planar": 'replace it by revolute joints, or fix it with type="fixed"',
}


def quoted(text: str | None) -> str:
    """Returns a name of a URDF as part of an error message, at most 80 characters long."""
    return repr((text or "")[:_MAX_QUOTED])


def check_tree(root: ET.Element) -> str:
    """Checks the links and joints of a URDF, and returns the name of the root link.

    Args:
        root: The ``<robot>`` element.

    Raises:
        InputError: The links and joints do not form one tree of hinges.
    """
    links = _names(root, "link")
    _names(root, "joint")
    parents: dict[str, str] = {}
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        parent, child = (_end(joint, end, links) for end in ("parent", "child"))
        if child in parents:
            raise InputError(
                f"the link {quoted(child)} has two parents, {quoted(parents[child])} and "
                f"{quoted(parent)}: expected a tree, so remove one of the joints "
                f"(the second is {quoted(name)})"
            )
        parents[child] = parent
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        found = ", ".join(map(quoted, roots[:5])) or "none (the joints form a circle)"
        raise InputError(
            f"expected one link without a parent, the root of the robot, got {found}: keep the "
            f"robot, and connect its links by joints"
        )
    _check_depths(links, parents)
    return roots[0]


def _names(root: ET.Element, tag: str) -> Counter[str]:
    counts = Counter(element.get("name", "") for element in root.findall(tag))
    if tag == "link" and not counts:
        raise InputError("the URDF has no <link>: expected the links of a robot")
    for name, count in counts.items():
        if not name or count > 1:
            raise InputError(
                f"expected a different name for each <{tag}>, got {quoted(name)} {count} times"
            )
    return counts


def check_types(root: ET.Element) -> None:
    """Checks that all joints of a URDF are hinges, or fixed.

    Raises:
        InputError: A joint has another type; the message has the remedy.
    """
    for joint in root.findall("joint"):
        kind, name = joint.get("type", ""), joint.get("name", "")
        if kind not in JOINT_TYPES:
            remedy = _REMEDIES.get(kind, f"expected one of {', '.join(JOINT_TYPES)}")
            raise InputError(f"the joint {quoted(name)} has the type {quoted(kind)}: {remedy}")


def _end(joint: ET.Element, end: str, links: Collection[str]) -> str:
    element = joint.find(end)
    link = "" if element is None else element.get("link", "")
    if link not in links:
        raise InputError(
            f"the <{end}> of the joint {quoted(joint.get('name'))} is the link {quoted(link)}, "
            f"which the URDF does not have"
        )
    return link


def _check_depths(links: Collection[str], parents: dict[str, str]) -> None:
    depths: dict[str, int] = {}
    for link in links:
        chain = []
        at: str | None = link
        while at is not None and at not in depths:
            if at in chain:
                raise InputError(f"the joints form a circle through the link {quoted(at)}")
            chain.append(at)
            if len(chain) > MAX_LINK_DEPTH:
                raise InputError(f"the URDF has more than {MAX_LINK_DEPTH} links in one chain")
            at = parents.get(at)
        depth = -1 if at is None else depths[at]
        for name in reversed(chain):
            depth += 1
            depths[name] = depth
    if max(depths.values()) >= MAX_LINK_DEPTH:
        raise InputError(f"the URDF has more than {MAX_LINK_DEPTH} links in one chain")
