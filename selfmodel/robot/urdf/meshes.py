"""Meshes of a URDF: paths such as ``package://name/meshes/leg.stl``, and the files behind them."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from posixpath import join, normpath, splitext
from urllib.parse import unquote

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.document.document import Document, plain_name
from selfmodel.robot.mjcf.document.files import Files
from selfmodel.robot.urdf.tree import quoted

READABLE = (".stl", ".obj")
"""Endings of the meshes of a URDF that MuJoCo reads."""

_PACKAGE_SCHEMES = ("package://", "model://")
_ABOVE = ("", "..", "../..", "../../..")
"""Folders of a package, from the folder of its URDF: ``NAME/urdf/x.urdf``, and one level deeper."""


@dataclass
class Meshes:
    """The meshes of a URDF, read into a document.

    Attributes:
        files: Source of the files, by their paths relative to the URDF.
        limit: Largest sum of the files, bytes.
        document: The URDF; the contents of the files are added to its assets.
    """

    files: Files
    limit: int
    document: Document
    _names: dict[str, str] = field(default_factory=dict)

    def find(self, uri: str) -> str | None:
        """Returns the path of a mesh relative to the URDF, or None if no readable file exists.

        A mesh in another format is replaced by the file of the same name that ends in ``.stl`` or
        ``.obj``, if there is one.
        """
        for path in _candidates(uri):
            stem, ending = splitext(path)
            other = [stem + readable for readable in READABLE]
            for name in [path] if ending.lower() in READABLE else other:
                if self.files.has(name):
                    return name
        return None

    def add(self, path: str, uri: str) -> str:
        """Reads a mesh, and returns its name among the assets.

        Args:
            path: Path of the file, as returned by ``find``.
            uri: The path in the URDF, for an error message.

        Raises:
            InputError: The files are too large.
        """
        if path not in self._names:
            assets = self.document.assets
            data = self.files.read(path, f"the file of a <mesh> ({quoted(uri)})", self.limit)
            if sum(map(len, assets.values())) + len(data) > self.limit:
                raise InputError(
                    f"the meshes of the URDF have over {self.limit} bytes: simplify them"
                )
            self._names[path] = plain_name(path, assets)
            assets[self._names[path]] = data
        return self._names[path]


def _candidates(uri: str) -> Iterator[str]:
    """Yields the possible paths of a file, relative to the URDF, the most specific first."""
    text = uri.replace("\\", "/")
    if text.startswith("file://"):
        yield unquote(text.removeprefix("file://"))
        return
    scheme = next((scheme for scheme in _PACKAGE_SCHEMES if text.startswith(scheme)), None)
    if scheme is None:
        yield normpath(text)
        return
    whole = unquote(text.removeprefix(scheme))
    _package, _, inside = whole.partition("/")
    for above in _ABOVE:
        yield normpath(join(above, inside))
        yield normpath(join(above, whole))
