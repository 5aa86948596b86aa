"""Makes an MJCF explicit: no copies, frames, scaled masses or state that no log contains."""

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from xml.etree import ElementTree as ET  # of checked texts, or of texts from MuJoCo

import mujoco
import numpy as np

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document import Document, format_numbers
from selfmodel.robot.mujoco_errors import loading_a_model

_COPYING_ELEMENTS = ("replicate", "composite")


def expand(document: Document) -> None:
    """Expands copies, frames and ``settotalmass`` into explicit elements.

    Afterwards the compiled model has the bodies and geoms of the text, in the same order.
    """
    _keep_all_elements(document)
    tags = {element.tag for element in document.root.iter()}
    used = [tag for tag in (*_COPYING_ELEMENTS, "frame") if tag in tags]
    if used:
        with loading_a_model():
            spec = mujoco.MjSpec.from_string(document.text, assets=document.assets)
            spec.compile()
            document.root = ET.fromstring(spec.to_xml())  # noqa: S314  # the text is from MuJoCo
        dissolve_frames(document)
        document.notes.append(
            f"MuJoCo wrote out the <{'>, <'.join(used)}> elements, with numbers of six digits"
        )
    compilers = list(document.root.iter("compiler"))
    if any(compiler.get("settotalmass") for compiler in compilers):
        write_masses(document)
        document.notes.append("the masses are written out, as scaled by settotalmass")


def _keep_all_elements(document: Document) -> None:
    """Removes the compiler flags that make MuJoCo drop bodies or geoms of the text."""
    for compiler in document.root.iter("compiler"):
        for attribute in ("fusestatic", "discardvisual"):
            if compiler.attrib.pop(attribute, "false") == "true":
                document.notes.append(
                    f"{attribute} is removed: each body and geom of the file is kept"
                )


def write_masses(document: Document) -> None:
    """Writes the masses and inertias of the compiled model into the bodies of the text."""
    model = document.model
    for body, element in zip(range(1, model.nbody), document.bodies(), strict=True):
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
    for compiler in document.root.iter("compiler"):
        compiler.attrib.pop("settotalmass", None)
        compiler.attrib.pop("inertiafromgeom", None)
    # A body without an <inertial> has no mass, whatever the density of its geoms.
    document.section("compiler").set("inertiafromgeom", "false")


_TOLERANCE = 1e-6
"""Largest difference of a pose, m and unit vectors; MuJoCo writes six digits."""

_Placed = Callable[[mujoco.MjModel, int], dict[str, np.ndarray]]

_POSES = ("body_pos", "body_quat", "geom_pos", "geom_quat", "site_pos", "jnt_pos", "jnt_axis")


def dissolve_frames(document: Document) -> None:
    """Dissolves all frames of a document, in place.

    Raises:
        InputError: MuJoCo cannot compile the document, or a pose would change.
    """
    if not any(element.tag == "frame" for element in document.root.iter()):
        return
    model = document.model
    moved: set[ET.Element] = set()
    for world in document.root.findall("worldbody"):
        for parent in [world, *world.iter("body")]:
            _unwrap(parent, moved)
    bodies = [None, *document.bodies()]
    worlds = [child for world in document.root.findall("worldbody") for child in world]
    for body, element in enumerate(bodies):
        if element in moved:
            _write(element, _placed_body(model, body))
        children = worlds if element is None else list(element)
        for tags, placed, ids in _parts(model, body):
            for child, number in zip((c for c in children if c.tag in tags), ids, strict=True):
                if child in moved:
                    _write(child, placed(model, number))
    _check_same(model, document.model)


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


def _parts(
    model: mujoco.MjModel, body: int
) -> Iterator[tuple[tuple[str, ...], _Placed, list[int]]]:
    """Yields the tags, the poses and the ids of each kind of part of a body."""
    for tags, (owner, placed) in _KINDS.items():
        yield tags, placed, np.flatnonzero(getattr(model, owner) == body).tolist()


def _placed_body(model: mujoco.MjModel, body: int) -> dict[str, np.ndarray]:
    return {"pos": model.body_pos[body], "quat": model.body_quat[body]}


def _placed_geom(model: mujoco.MjModel, geom: int) -> dict[str, np.ndarray]:
    position, orientation = model.geom_pos[geom], model.geom_quat[geom]
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        return {"pos": position, "quat": orientation}
    # MuJoCo adds the pose of the mesh in its file to the pose in the text.
    mesh = int(model.geom_dataid[geom])
    inverse, own, shift = np.empty(4), np.empty(4), np.empty(3)
    mujoco.mju_negQuat(inverse, model.mesh_quat[mesh])
    mujoco.mju_mulQuat(own, orientation, inverse)
    mujoco.mju_rotVecQuat(shift, model.mesh_pos[mesh], own)
    return {"pos": position - shift, "quat": own}


def _placed_joint(model: mujoco.MjModel, joint: int) -> dict[str, np.ndarray]:
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
        return {}
    return {"pos": model.jnt_pos[joint], "axis": model.jnt_axis[joint]}


def _placed_site(model: mujoco.MjModel, site: int) -> dict[str, np.ndarray]:
    return {"pos": model.site_pos[site], "quat": model.site_quat[site]}


def _placed_camera(model: mujoco.MjModel, camera: int) -> dict[str, np.ndarray]:
    return {"pos": model.cam_pos[camera], "quat": model.cam_quat[camera]}


def _placed_light(model: mujoco.MjModel, light: int) -> dict[str, np.ndarray]:
    return {"pos": model.light_pos[light], "dir": model.light_dir[light]}


_KINDS: Mapping[tuple[str, ...], tuple[str, _Placed]] = MappingProxyType(
    {
        ("geom",): ("geom_bodyid", _placed_geom),
        ("joint", "freejoint"): ("jnt_bodyid", _placed_joint),
        ("site",): ("site_bodyid", _placed_site),
        ("camera",): ("cam_bodyid", _placed_camera),
        ("light",): ("light_bodyid", _placed_light),
    }
)
"""Attribute of the model with the body of each part, and the pose of a part, by its tags."""


def _write(element: ET.Element, placed: dict[str, np.ndarray]) -> None:
    for attribute, values in placed.items():
        element.set(attribute, " ".join(repr(float(value)) for value in values))


def _check_same(before: mujoco.MjModel, after: mujoco.MjModel) -> None:
    for name in _POSES:
        old, new = getattr(before, name), getattr(after, name)
        if old.shape != new.shape or not np.allclose(old, new, atol=_TOLERANCE):
            raise InputError(
                f"the <frame> elements of the MJCF cannot be written out ({name}): write the poses "
                f"of their children by hand"
            )


MIN_ITERATIONS = {"iterations": 100, "ls_iterations": 50}
"""Least iterations of a solver without warm start, MuJoCo's defaults, by option. A Unitree Go1 with
one iteration, as MJX's models have, stands 9 mm lower without warm start, and 0.1 mm higher with 3;
Newton's method converges after 4 and stops."""

_WARM_START = int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
_SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def remove_hidden_state(document: Document) -> None:
    """Turns off what makes a physics step depend on more than the state that a log contains.

    MuJoCo's solver starts at the acceleration of the step before (``qacc_warmstart``), which no log
    contains. A solver that stops before convergence, for example after one iteration, then computes
    another acceleration from a logged state than in the trial. Without the warm start, the
    acceleration is the same to the bit, and the solver needs more iterations for it.

    Args:
        document: The MJCF, edited in place.
    """
    model = document.model
    if not model.opt.disableflags & _WARM_START:
        _disable(document, "warmstart")
        document.notes.append(
            "the solver's warm start is off: each physics step depends on the logged state alone"
        )
        _raise_iterations(document, model)
    if model.opt.enableflags & _SLEEP:
        _disable(document, "sleep")
        document.notes.append("sleep is off: no log contains which bodies are asleep")


def _raise_iterations(document: Document, model: mujoco.MjModel) -> None:
    raised = []
    for name, least in MIN_ITERATIONS.items():
        own = int(getattr(model.opt, name))
        if own < least:
            _set_option(document, name, str(least))
            raised.append(f"{name} from {own} to {least}")
    if raised:
        document.notes.append(
            f"a solver without warm start needs more iterations: {', '.join(raised)}"
        )


def _set_option(document: Document, name: str, value: str) -> None:
    # Of several <option> elements, the last with the attribute determines it.
    for option in document.root.findall("option"):
        option.attrib.pop(name, None)
    document.section("option").set(name, value)


def _disable(document: Document, flag: str) -> None:
    # MuJoCo accepts one <flag> in all <option> elements together.
    flags = document.root.find("option/flag")
    if flags is None:
        flags = ET.SubElement(document.section("option"), "flag")
    flags.set(flag, "disable")


_RESERVATIONS = ("njmax", "nconmax")
"""Attributes of ``<size>`` that MuJoCo 2.3 replaced by ``memory``."""

_LARGE = 2000
"""Largest number that stays. Memory grows with its square: 8000 constraints reserve 3 GB."""


def drop_large_reservations(document: Document) -> None:
    """Removes large numbers of contacts and constraints: MuJoCo then chooses the memory itself.

    Each thread of a simulation has this memory; the rodent of dm_control reserves 3 GB.

    Args:
        document: The MJCF, edited in place.
    """
    dropped = [
        f"{attribute}={size.attrib.pop(attribute)}"
        for size in document.root.findall("size")
        for attribute in _RESERVATIONS
        if _is_large(size.get(attribute, ""))
    ]
    if dropped:
        document.notes.append(f"MuJoCo chooses its memory itself, without {', '.join(dropped)}")


def _is_large(text: str) -> bool:
    try:
        return int(text) > _LARGE
    except ValueError:  # MuJoCo reports what is no number
        return False
