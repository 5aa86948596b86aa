"""Mutations of MJCF: attributes with extreme values, elements doubled, nested, moved or new."""

import copy
import re
from collections.abc import Mapping
from functools import cache
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from tests.fuzz.mutate import data as raw
from tests.fuzz.mutate.numbers import number, number_text, text


@cache
def attributes() -> dict[str, tuple[str, ...]]:
    """Returns the attributes of each element, from MuJoCo's schema; of some elements merged."""
    found: dict[str, list[str]] = {}
    tag = ""
    for line in mujoco.mj_printSchema(False, False).splitlines():
        element, words = line[:30].split(), line[30:].split()
        tag = element[0] if element else tag
        found.setdefault(tag, []).extend(words)
    return {tag: tuple(dict.fromkeys(words)) for tag, words in found.items() if words}


WORDS = (
    *("true", "false", "auto", "enable", "disable", "sphere", "box", "capsule", "ellipsoid"),
    *(
        "mesh",
        "cylinder",
        "plane",
        "hfield",
        "sdf",
        "hinge",
        "slide",
        "ball",
        "free",
        "radian",
        "degree",
    ),
    *("implicitfast", "RK4", "Euler", "Newton", "PGS", "CG", "elliptic", "sparse", "integrator"),
    *("filter", "filterexact", "muscle", "user", "none", "affine", "torso", "left_hip_x", "world"),
)
"""Keywords and names that an attribute may have."""

FRAGMENTS = {
    "mujoco": (
        '<option timestep="1e-7"/>',
        '<option integrator="implicit" cone="elliptic" jacobian="sparse"/>',
        '<option gravity="0 0 1e300"/>',
        '<option density="1e9" viscosity="1e9" wind="1e9 0 0"/>',
        '<option><flag contact="disable" energy="enable" sleep="enable"/></option>',
        '<size memory="1K" nkey="3" nuserdata="100"/>',
        '<compiler angle="radian" autolimits="false" inertiafromgeom="true"/>',
        '<compiler discardvisual="true" fusestatic="true" settotalmass="1e-9"/>',
        '<default><geom contype="0"/><default class="d"><joint damping="-5"/></default></default>',
        '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>',
        '<asset><hfield name="h" nrow="40" ncol="40" size="1 1 1 1"/></asset>',
        '<asset><texture name="t" type="2d" builtin="flat" width="9" height="9"/></asset>',
        '<asset><mesh name="m" file="foot.obj"/></asset>',
        '<asset><mesh name="m" file="../x.obj"/></asset>',
        '<asset><model name="x" file="x.xml"/></asset>',
        '<contact><pair geom1="a" geom2="b"/></contact>',
        '<contact><exclude name="e" body1="torso" body2="left_leg"/></contact>',
        '<equality><joint joint1="left_hip_x" polycoef="0 1 0 0 0"/></equality>',
        '<equality><weld body1="torso"/></equality>',
        '<equality><connect body1="torso" body2="left_leg" anchor="1e9 0 0"/></equality>',
        '<tendon><fixed name="f"><joint joint="left_hip_x" coef="1e30"/></fixed></tendon>',
        '<tendon><spatial><site site="left_sole"/><site site="right_sole"/></spatial></tendon>',
        '<keyframe><key name="home" qpos="1 2 3"/></keyframe>',
        '<keyframe><key qpos="nan 0 0 1 0 0 0 0 0 0 0"/></keyframe>',
        '<custom><numeric name="n" size="5" data="1 2"/><text name="t" data="x"/></custom>',
        '<extension><plugin plugin="mujoco.pid"/></extension>',
        '<include file="model.xml"/>',
        '<visual><global offwidth="99999"/><quality shadowsize="999999"/></visual>',
        '<statistic extent="nan" meansize="0"/>',
        '<actuator><muscle name="u" joint="left_hip_x"/></actuator>',
        '<actuator><general joint="left_hip_x" dyntype="integrator" actlimited="true"/></actuator>',
        '<actuator><velocity name="v" joint="left_hip_x" kv="1e300"/></actuator>',
        '<actuator><adhesion name="z" body="torso" ctrlrange="0 1"/></actuator>',
        '<actuator><motor name="w" site="left_sole" gear="1 0 0 0 0 0"/></actuator>',
        '<sensor><accelerometer name="acc" site="left_sole"/></sensor>',
        '<sensor><rangefinder name="r" site="left_sole"/></sensor>',
        '<sensor><user name="us" dim="9999"/></sensor>',
        '<sensor><jointpos name="j" joint="root"/></sensor>',
        '<deformable><flex name="f" dim="1"/></deformable>',
        "<worldbody><body><freejoint/></body></worldbody>",
    ),
    "body": (
        "<freejoint/>",
        '<joint name="extra" axis="0 0 0"/>',
        '<joint name="ball" type="ball"/>',
        '<joint name="slide" type="slide" range="1 -1"/>',
        '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>',
        '<inertial pos="0 0 0" mass="1e300" diaginertia="1e-300 1 1"/>',
        '<geom type="sphere" size="1e9"/>',
        '<geom type="hfield" hfield="h"/>',
        '<geom type="mesh" mesh="m"/>',
        '<geom size="-1"/>',
        '<site name="left_sole" size="1"/>',
        '<camera name="c" resolution="9999 9999"/>',
        '<light name="l"/>',
        '<replicate count="30" offset=".1 0 0"><geom size=".01"/></replicate>',
        '<frame euler="0 90 0"><geom size=".1"/></frame>',
        '<composite type="cable" count="20 1 1" prefix="q"><geom size=".01"/></composite>',
        '<flexcomp name="fl" type="grid" count="4 4 1" mass="1" spacing=".1 .1 .1"/>',
        '<attach model="x" body="y" prefix="z"/>',
        '<body mocap="true" pos="0 0 9"><geom size=".1"/></body>',
        '<plugin plugin="mujoco.sdf.bolt"/>',
        '<body gravcomp="1e9"><joint/><geom size=".01"/></body>',
    ),
}
"""New elements, by the element that they go into."""


Fragments = Mapping[str, tuple[str, ...]]


def mutated(
    data: bytes, rng: np.random.Generator, fragments: Fragments = FRAGMENTS
) -> tuple[bytes, str]:
    """Returns XML with one to three mutations, and their names.

    Args:
        data: The XML.
        rng: Source of the mutations.
        fragments: New elements, by the element that they go into: the root, and another.
    """
    if rng.random() < 0.07:
        return raw.mutated(data, rng)
    try:
        root = ET.fromstring(data)  # noqa: S314  # seeds of this repository
    except ET.ParseError:  # an earlier mutation
        return raw.mutated(data, rng)
    names = [_change(root, rng, fragments) for _ in range(int(rng.choice([1, 1, 1, 2, 3])))]
    try:
        return ET.tostring(root), ", ".join(names)
    except (ValueError, RecursionError):  # ElementTree cannot write what was made
        return raw.mutated(data, rng)


def _change(root: ET.Element, rng: np.random.Generator, fragments: Fragments) -> str:
    every = list(root.iter())
    parents = {child: parent for parent in every for child in parent}
    chosen = every[int(rng.integers(1, len(every)))] if len(every) > 1 else root
    kind = int(rng.integers(12))
    if kind < 5 and chosen.attrib:
        name = str(rng.choice(sorted(chosen.attrib)))
        chosen.set(name, _value(chosen.get(name, ""), rng, every))
        return f"<{chosen.tag} {name}={chosen.get(name)!r:.60}>"
    if kind == 5 and chosen.attrib:
        name = str(rng.choice(sorted(chosen.attrib)))
        del chosen.attrib[name]
        return f"<{chosen.tag}> without {name}"
    if kind == 6:
        known = attributes().get(chosen.tag, ("name",))
        name = known[rng.integers(len(known))]
        chosen.set(name, _value("1 1 1"[: int(rng.integers(1, 6))], rng, every))
        return f"<{chosen.tag} {name}={chosen.get(name)!r:.60}>"
    if chosen is root or kind in (7, 8):
        at_root, within = fragments
        tag = within if rng.random() < 0.5 else at_root
        holders = [element for element in every if element.tag == tag] or [root]
        pieces = fragments[tag]
        piece = pieces[rng.integers(len(pieces))]
        holder = holders[rng.integers(len(holders))]
        holder.insert(int(rng.integers(len(holder) + 1)), ET.fromstring(piece))  # noqa: S314
        return f"<{holder.tag}> with {piece}"
    parent = parents[chosen]
    if kind == 9:
        count = int(rng.choice([1, 1, 2, 30, 300]))
        parent.extend(copy.deepcopy(chosen) for _ in range(count))
        return f"<{chosen.tag}> {count} times more"
    parent.remove(chosen)
    if kind == 10:
        other = every[rng.integers(len(every))]
        if other not in list(chosen.iter()):
            other.append(chosen)
            return f"<{chosen.tag}> moved into <{other.tag}>"
        return f"<{chosen.tag}> removed"
    depth = int(rng.choice([1, 3, 20, 120]))
    nested = chosen
    for _ in range(depth):
        outer = ET.Element(chosen.tag)
        outer.append(nested)
        nested = outer
    parent.append(nested)
    return f"<{chosen.tag}> in {depth} of its kind"


def _value(old: str, rng: np.random.Generator, every: list[ET.Element]) -> str:
    kind = int(rng.integers(8))
    words = old.split()
    if kind < 5 and words and re.fullmatch(r"[-+.0-9e]+", words[0]):
        at = int(rng.integers(len(words)))
        usual = re.fullmatch(r"[-+]?[0-9]*\.?[0-9]+", words[at])
        scaled = usual and kind < 2
        words[at] = repr(float(words[at]) * float(rng.normal())) if scaled else repr(number(rng))
        return " ".join(words)
    if kind == 5:
        return " ".join(repr(number(rng)) for _ in range(int(rng.integers(0, 8))))
    if kind == 6:
        found = [element.get("name", "") for element in every if element.get("name")]
        return str(rng.choice(found)) if found else ""
    if kind < 3:
        return number_text(rng)
    if kind == 7:
        return WORDS[rng.integers(len(WORDS))]
    # XML 1.0 has no other control characters.
    return re.sub("[\x00-\x08\x0b\x0c\x0e-\x1f]", "", text(rng))
