"""Makes an MJCF explicit: parts with names, no copies or frames, no state that no log contains."""

import re
from collections.abc import Mapping
from xml.etree import ElementTree as ET  # of checked texts, or of texts from MuJoCo

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.work import UniqueNames, Work, format_numbers
from selfmodel.robot.mujoco_errors import loading_a_model
from selfmodel.robot.robot import mjcf_of

MIN_ITERATIONS = {"iterations": 100, "ls_iterations": 50}
"""Least iterations of a solver without warm start, MuJoCo's defaults, by option. A Unitree Go1 with
one iteration, as MJX's models have, stands 9 mm lower without warm start, and 0.1 mm higher with 3;
Newton's method converges after 4 and stops."""

_LARGE = 2000
"""Largest njmax or nconmax that stays. Memory grows with its square: 8000 constraints are 3 GB."""

_COPYING_ELEMENTS = ("replicate", "composite")

_TOLERANCE = 1e-6
"""Largest difference of a pose, m and unit vectors; MuJoCo writes six digits."""


def drop_large_reservations(work: Work) -> None:
    """Removes large numbers of contacts and constraints: MuJoCo then chooses the memory itself.

    Each thread of a simulation has this memory; the rodent of dm_control reserves 3 GB.
    """
    dropped = [
        f"{attribute}={size.attrib.pop(attribute)}"
        for size in work.root.findall("size")
        for attribute in ("njmax", "nconmax")
        if (text := size.get(attribute, "")).strip().isdecimal() and int(text) > _LARGE
    ]
    if dropped:
        work.notes.append(f"MuJoCo chooses its memory itself, without {', '.join(dropped)}")


def expand(work: Work) -> None:
    """Expands copies, frames and ``settotalmass`` into explicit elements.

    Afterwards the compiled model has the bodies and geoms of the text, in the same order.
    """
    for compiler in work.root.iter("compiler"):
        for attribute in ("fusestatic", "discardvisual"):
            if compiler.attrib.pop(attribute, "false") == "true":
                work.notes.append(f"{attribute} is removed: each body and geom of the file is kept")
    tags = {element.tag for element in work.root.iter()}
    used = [tag for tag in (*_COPYING_ELEMENTS, "frame") if tag in tags]
    if used:
        with loading_a_model():
            spec = mujoco.MjSpec.from_string(work.text, assets=work.assets)
            spec.compile()
            work.root = ET.fromstring(mjcf_of(spec))  # noqa: S314  # the text is from MuJoCo
        _dissolve_frames(work)
        work.notes.append(
            f"MuJoCo wrote out the <{'>, <'.join(used)}> elements, with numbers of six digits"
        )
    if any(compiler.get("settotalmass") for compiler in work.root.iter("compiler")):
        write_masses(work)
        work.notes.append("the masses are written out, as scaled by settotalmass")


def write_masses(work: Work) -> None:
    """Writes the masses and inertias of the compiled model into the bodies of the text."""
    model = work.model
    for body, element in zip(range(1, model.nbody), work.bodies(), strict=True):
        for existing in element.findall("inertial"):
            element.remove(existing)
        if model.body_mass[body] == 0:
            continue
        inertial = {
            "pos": format_numbers(model.body_ipos[body]),
            "quat": format_numbers(model.body_iquat[body]),
            "mass": repr(float(model.body_mass[body])),
            "diaginertia": format_numbers(model.body_inertia[body]),
        }
        element.insert(0, ET.Element("inertial", inertial))
    for compiler in work.root.iter("compiler"):
        compiler.attrib.pop("settotalmass", None)
        compiler.attrib.pop("inertiafromgeom", None)
    # A body without an <inertial> has no mass, whatever the density of its geoms.
    work.section("compiler").set("inertiafromgeom", "false")


_JOINT_TAGS, _FREE = ("joint", "freejoint"), mujoco.mjtJoint.mjJNT_FREE

_PLACES: Mapping[tuple[str, ...], tuple[str, dict[str, str]]] = {
    ("geom",): ("geom_bodyid", {"pos": "geom_pos", "quat": "geom_quat"}),
    _JOINT_TAGS: ("jnt_bodyid", {"pos": "jnt_pos", "axis": "jnt_axis"}),
    ("site",): ("site_bodyid", {"pos": "site_pos", "quat": "site_quat"}),
    ("camera",): ("cam_bodyid", {"pos": "cam_pos", "quat": "cam_quat"}),
    ("light",): ("light_bodyid", {"pos": "light_pos", "dir": "light_dir"}),
}
"""Fields of the model with the body and the place of each part of a body, by its tags."""

_POSES = ("body_pos", "body_quat", "geom_pos", "geom_quat", "site_pos", "jnt_pos", "jnt_axis")


def _dissolve_frames(work: Work) -> None:
    model = work.model
    moved: set[ET.Element] = set()
    for world in work.root.findall("worldbody"):
        for parent in [world, *world.iter("body")]:
            _unwrap(parent, moved)
    for body, element in enumerate([None, *work.bodies()]):
        if element in moved:
            place = {"pos": model.body_pos[body], "quat": model.body_quat[body]}
            _write(element, place)
        children = work.children("worldbody") if element is None else list(element)
        for tags, (owner, fields) in _PLACES.items():
            ids = np.flatnonzero(getattr(model, owner) == body).tolist()
            for child, number in zip((c for c in children if c.tag in tags), ids, strict=True):
                is_joint = child.tag in _JOINT_TAGS
                if child in moved and not (is_joint and model.jnt_type[number] == _FREE):
                    place = {key: getattr(model, name)[number] for key, name in fields.items()}
                    _write(child, _in_file(model, number, place) if child.tag == "geom" else place)
    for name in _POSES:
        old, new = getattr(model, name), getattr(work.model, name)
        if old.shape != new.shape or not np.allclose(old, new, atol=_TOLERANCE):
            raise InputError(
                f"the <frame> elements of the MJCF cannot be written out ({name}): write the poses "
                f"of their children by hand"
            )


def _unwrap(parent: ET.Element, moved: set[ET.Element]) -> None:
    """Replaces each frame among the children by the frame's children, recursively."""
    index = 0
    while index < len(parent):
        frame = parent[index]
        if frame.tag != "frame":
            index += 1
            continue
        for child in frame:
            attribute = "childclass" if child.tag in ("body", "frame") else "class"
            if frame.get("childclass") and not child.get(attribute) and child.tag != "freejoint":
                child.set(attribute, frame.get("childclass", ""))
            moved.add(child)
        parent[index : index + 1] = list(frame)


def _in_file(
    model: mujoco.MjModel, geom: int, place: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Returns the place of a geom without that of its mesh in the file, which MuJoCo adds."""
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        return place
    mesh = int(model.geom_dataid[geom])
    inverse, orientation, shift = np.empty(4), np.empty(4), np.empty(3)
    mujoco.mju_negQuat(inverse, model.mesh_quat[mesh])
    mujoco.mju_mulQuat(orientation, place["quat"], inverse)
    mujoco.mju_rotVecQuat(shift, model.mesh_pos[mesh], orientation)
    return {"pos": place["pos"] - shift, "quat": orientation}


def _write(element: ET.Element, values: dict[str, np.ndarray]) -> None:
    element.attrib.update({name: format_numbers(numbers) for name, numbers in values.items()})


def remove_hidden_state(work: Work) -> None:
    """Turns off what makes a physics step depend on more than the state that a log contains.

    MuJoCo's solver starts at the acceleration of the step before (``qacc_warmstart``), which no log
    contains. A solver that stops before convergence, for example after one iteration, then computes
    another acceleration from a logged state than in the trial. Without the warm start, the
    acceleration is the same to the bit, and the solver needs more iterations for it.
    """
    options = work.model.opt
    if not options.disableflags & int(mujoco.mjtDisableBit.mjDSBL_WARMSTART):
        _disable(work, "warmstart")
        work.notes.append(
            "the solver's warm start is off: each physics step depends on the logged state alone"
        )
        raised = []
        for name, least in MIN_ITERATIONS.items():
            given = int(getattr(options, name))
            if given < least:
                # Of several <option> elements, the last with the attribute determines it.
                for option in work.root.findall("option"):
                    option.attrib.pop(name, None)
                work.section("option").set(name, str(least))
                raised.append(f"{name} from {given} to {least}")
        if raised:
            work.notes.append(
                f"a solver without warm start needs more iterations: {', '.join(raised)}"
            )
    if options.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP):
        _disable(work, "sleep")
        work.notes.append("sleep is off: no log contains which bodies are asleep")


def _disable(work: Work, flag: str) -> None:
    # MuJoCo accepts one <flag> in all <option> elements together.
    flags = work.root.find("option/flag")
    if flags is None:
        flags = ET.SubElement(work.section("option"), "flag")
    flags.set(flag, "disable")


_SPECIAL_CHARACTERS = re.compile(r"[^\w.-]")

_REFERENCES: Mapping[str, tuple[str, ...]] = {
    "body": ("body", "body1", "body2", "subtree1", "subtree2", "target"),
    "joint": ("joint", "joint1", "joint2", "jointinparent"),
    "actuator": ("actuator",),
    "sensor": (),
}
"""Attributes that contain the name of a part, by kind of part. ``objname`` and ``refname`` are not
included: ``objtype`` and ``reftype`` contain their kind."""


def name_parts(work: Work) -> None:
    """Gives each body, joint, actuator and sensor a unique name.

    A body without a name gets the name of its first joint, a joint that of its body, an actuator
    that of its joint or tendon, a sensor that of its joint or its type. Special characters of
    notation become ``_``, also in references.
    """
    bodies = work.bodies()
    carriers = {joint: body for body in bodies for joint in body if joint.tag in _JOINT_TAGS}
    parts = {
        "body": bodies,
        "joint": list(carriers),
        "actuator": work.children("actuator"),
        "sensor": work.children("sensor"),
    }
    for kind, elements in parts.items():
        _replace_special_characters(work, kind, elements)
    unnamed = sum(
        element.get("name") is None
        for kind, elements in parts.items()
        for element in elements
        if kind != "sensor"
    )
    for kind, elements in parts.items():
        names = UniqueNames(element.get("name") for element in elements)
        for number, element in enumerate(elements, 1):
            if not element.get("name"):
                base = _default_name(kind, element, number, carriers)
                element.set("name", names.new(base))
    if unnamed:
        work.notes.append(f"{unnamed} parts without a name got one")


def _default_name(
    kind: str, element: ET.Element, number: int, carriers: Mapping[ET.Element, ET.Element]
) -> str:
    """Returns a name for a part without one; bodies have theirs before joints."""
    match kind:
        case "body":
            joints = (j.get("name") for j in element if j.tag == "joint" and j.get("name"))
            return next(joints, None) or f"body_{number}"
        case "joint":
            body = str(carriers[element].get("name"))
            return f"{body}_root" if element.tag == "freejoint" else body
        case "actuator":
            driven = (element.get(key) for key in ("joint", "jointinparent", "tendon"))
            return _SPECIAL_CHARACTERS.sub("_", next(filter(None, driven), "motor"))
        case _:
            angle = element.tag == "jointpos"
            return f"{element.get('joint')}_angle" if angle else element.tag


def _replace_special_characters(work: Work, kind: str, elements: list[ET.Element]) -> None:
    given = [name for element in elements if (name := element.get("name"))]
    names = UniqueNames(given)
    new = {
        name: names.new(_SPECIAL_CHARACTERS.sub("_", name))
        for name in dict.fromkeys(given)
        if _SPECIAL_CHARACTERS.search(name)
    }
    if not new:
        return
    for element in elements:
        _rename(element, "name", new)
    for element in work.root.iter():
        for attribute in _REFERENCES[kind]:
            _rename(element, attribute, new)
        for prefix in ("obj", "ref"):
            if element.get(f"{prefix}type", "").removeprefix("x") == kind:
                _rename(element, f"{prefix}name", new)
    work.notes.extend(f"the {kind} {old!r} is renamed to {name}" for old, name in new.items())


def _rename(element: ET.Element, attribute: str, new: Mapping[str, str]) -> None:
    if element.get(attribute) in new:
        element.set(attribute, new[str(element.get(attribute))])
