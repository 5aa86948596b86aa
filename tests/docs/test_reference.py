"""The reference has every public name, where its directives look for them."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

import selfmodel

pytest.importorskip("sphinx")

ROOT = Path(__file__).parents[2]
PAGES = "\n".join(page.read_text() for page in sorted((ROOT / "docs" / "reference").glob("*.md")))


def room() -> ModuleType:
    """The extension of Sphinx that documents a package."""
    place = ROOT / "docs" / "_ext" / "room.py"
    spec = importlib.util.spec_from_file_location("room", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def faces() -> list[str]:
    """The packages with a list of public names."""
    found = [stub.parent for stub in (ROOT / "selfmodel").glob("*/__init__.pyi")]
    return [f"selfmodel.{folder.name}" for folder in sorted(found)]


@pytest.mark.parametrize("name", faces())
def test_the_page_of_a_package_has_each_of_its_public_names_once(name: str):
    package = importlib.import_module(name)
    assert f"```{{room}} {name}\n" in PAGES

    lines = [line for line in room()._lines(package) if re.match(" *:members:|Instances:", line)]
    listed = [word for line in lines for word in re.findall(r"\w+", line.partition(": ")[2])]

    assert sorted(listed) == sorted(package.__all__)


def test_the_page_of_selfmodel_has_each_name_with_its_docstring():
    assert ".. automodule:: selfmodel\n" in PAGES
    for name in selfmodel.__all__:
        own = getattr(selfmodel, name)
        assert isinstance(own, tuple | str) or (own.__doc__ or "").strip(), name
