"""Files that no editor writes are refused in one sentence that names the file."""

from pathlib import Path

import pytest

from selfmodel import load_robot
from selfmodel.errors import InputError
from tests.logs.conftest import MJCF

ROT13 = '<?xml version="1.0" encoding="rot13"?>'


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("a.xml", ROT13 + MJCF, "rot13"),
        ("a.urdf", ROT13 + '<robot name="a"><link name="b"/></robot>', "rot13"),
        ("a.xml", MJCF.replace("left_hip_x", "j" * 100_000), "100000"),
        (
            "a.xml",
            MJCF.replace(
                "<worldbody>", '<asset><hfield name="m" file="m.png"/></asset><worldbody>', 1
            ),
            r"m\.png",
        ),
    ],
    ids=["encoding", "encoding of a URDF", "name", "loop of links"],
)
def test_a_file_that_no_editor_writes_is_refused(tmp_path: Path, name: str, text: str, named: str):
    (tmp_path / "m.png").symlink_to("n.png")
    (tmp_path / "n.png").symlink_to("m.png")
    (tmp_path / name).write_text(text)

    with pytest.raises(InputError, match=named) as refusal:
        load_robot(tmp_path / name)
    assert str(refusal.value).startswith(str(tmp_path))
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 1000
