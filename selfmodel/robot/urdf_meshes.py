"""Finds the mesh files that a URDF names.

A URI is a path relative to the URDF, or to the package that contains it (``package://``).
"""

from collections import Counter
from posixpath import join, normpath, splitext
from urllib.parse import unquote
from xml.etree import ElementTree as ET

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.untrusted import Files
from selfmodel.robot.mjcf.work import Work

READABLE = (".stl", ".obj")
"""Endings of the meshes of a URDF that MuJoCo reads."""

_PACKAGE_SCHEMES = ("package://", "model://")
_ABOVE = ("", "..", "../..", "../../..")
"""Folders of a package, from the folder of its URDF: ``NAME/urdf/x.urdf``, and one level deeper."""

SHAPES = ("visual", "collision")
_MAX_QUOTED = 80


def read_meshes(urdf: ET.Element, work: Work, files: Files) -> None:
    """Reads the meshes, and removes shapes of size 0 and visuals whose mesh cannot be read."""
    parts = [(link, e) for link in urdf.findall("link") for e in link if e.tag in SHAPES]
    empty = [part for part in parts if _is_empty(part[1].find("geometry/*"))]
    for link, part in empty:
        link.remove(part)
    if empty:
        work.notes.append(f"{len(empty)} shapes of size 0 are left out")
    left_out = Counter[str]()
    for link, part in parts:
        mesh = part.find("geometry/mesh")
        if mesh is None:
            continue
        uri = mesh.get("filename", "")
        path = next((path for path in _paths(uri) if files.has(path)), None)
        if path is not None:
            mesh.set("filename", work.add_asset(files, path, f"<mesh> ({quoted(uri)})"))
        elif part.tag == "visual":
            link.remove(part)
            left_out[_why_unread(uri)] += 1
        else:
            raise InputError(
                f"the collision of the link {quoted(link.get('name'))} needs the mesh "
                f"{quoted(uri)}, which is missing, lies outside the folders of the model, or "
                f"is no STL or OBJ: save the mesh as .stl, or name a folder that contains it, "
                f"with --set assets=DIR"
            )
    for reason, count in left_out.items():
        work.notes.append(f"{count} visual meshes are left out: {reason}")


def _is_empty(shape: ET.Element | None) -> bool:
    if shape is None:
        return True
    sizes = (shape.get(name, "").split() for name in ("size", "radius", "length"))
    return any(float(size) == 0 for words in sizes for size in words)


def _why_unread(uri: str) -> str:
    ending = "." + uri.rpartition(".")[2].lower()
    if ending in READABLE:
        return f"their files were not found, such as {quoted(uri)}"
    return f"MuJoCo reads no {ending[:10]}, expected {' or '.join(READABLE)}"


def _paths(uri: str) -> list[str]:
    """Returns the possible paths of a mesh, relative to the URDF, the most specific first.

    In place of a mesh in another format, it is the file of the same name that ends in ``.stl`` or
    ``.obj``.
    """
    text = uri.replace("\\", "/")
    scheme = next((scheme for scheme in _PACKAGE_SCHEMES if text.startswith(scheme)), None)
    if text.startswith("file://"):
        paths = [unquote(text.removeprefix("file://"))]
    elif scheme is None:
        paths = [normpath(text)]
    else:
        whole = unquote(text.removeprefix(scheme))
        inside = whole.partition("/")[2]  # of the package
        paths = [normpath(join(above, below)) for above in _ABOVE for below in (inside, whole)]
    stems = [splitext(path) for path in paths]
    return [
        stem + each
        for stem, ending in stems
        for each in ((ending,) if ending.lower() in READABLE else READABLE)
    ]


def quoted(text: str | None) -> str:
    """Returns a name of a URDF as part of an error message, at most 80 characters long."""
    return repr((text or "")[:_MAX_QUOTED])
