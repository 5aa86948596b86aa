import dataclasses
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import WorkError
from selfmodel.logs import LogError, read_log, robots
from selfmodel.logs.reader import TrialLog
from selfmodel.logs.robots import robot_of
from selfmodel.robot.mjcf import load
from tests.helpers.robots.menagerie import stl
from tests.logs.conftest import MJCF

TASKS = Path(__file__).parents[2] / "tasks"


@pytest.fixture(scope="module")
def trial(sound: Path) -> TrialLog:
    return read_log(sound)


def attacked(trial: TrialLog, mjcf: str, files: Mapping[str, bytes] | None = None) -> TrialLog:
    return dataclasses.replace(trial, mjcf=mjcf, assets=files or {})


def top(text: str) -> str:
    """The biped's model with something before its bodies."""
    return MJCF.replace("<worldbody>", f"{text}<worldbody>", 1)


def within(end: str, text: str) -> str:
    """The biped's model with something at the end of an element."""
    return MJCF.replace(end, f"{text}{end}", 1)


def asset(text: str) -> str:
    return top(f"<asset>{text}</asset>")


def mesh(file: str, more: str = "") -> str:
    model = asset(f'<mesh name="m" file="{file}" {more}/>')
    return model.replace("<worldbody>", '<worldbody><geom type="mesh" mesh="m"/>')


def png(width: int, height: int) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pixels = zlib.compress(bytes((3 * width + 1) * height))
    chunks = [(b"IHDR", header), (b"IDAT", pixels), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


CORNERS = np.random.default_rng(0).normal(size=(50, 3, 3))
STL = stl(CORNERS / np.linalg.norm(CORNERS, axis=-1, keepdims=True))
"""Triangles whose corners all lie on a sphere, so that each is a corner of the hull."""

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.usefixtures("isolated")
def test_a_child_process_is_the_first_to_open_the_model_of_a_log(
    trial: TrialLog, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.delattr(load, "build_and_step")  # of this process
    opened = robot_of(attacked(trial, top("<!-- opened for the first time -->"), trial.assets))

    assert opened.anatomy.names == trial.trial.trajectory.names


@pytest.mark.parametrize(
    ("mjcf", "files"),
    [
        (mesh("m.stl"), {"m.stl": STL}),
        (mesh("m.obj"), {"m.obj": OBJ}),
        (asset('<texture name="t" type="2d" file="t.png"/>'), {"t.png": png(8, 8)}),
        (asset('<texture name="t" builtin="gradient" width="512" height="3072"/>'), {}),
        (mesh("m.stl"), {"m.stl": STL, "../../etc/passwd": b"", "a\0b": b"", "\x1b[2J": b""}),
    ],
)
def test_what_is_attached_and_small_loads(trial: TrialLog, mjcf: str, files: dict[str, bytes]):
    robot = robot_of(attacked(trial, mjcf, files))
    assert set(robot.assets) <= {"m.stl", "m.obj", "t.png"}


@pytest.mark.parametrize(
    "element",
    [
        *[
            f'<mesh name="m" file="{file}"/>'
            for file in ("/etc/passwd", "../m.stl", "file:///m.stl", "M.STL", "m.stl&#10;")
        ],
        '<texture name="t" type="cube" fileright="/etc/passwd"/>',
        '<hfield name="h" size="1 1 1 1" file="../m.stl"/>',
    ],
)
def test_no_file_is_read_but_those_attached(trial: TrialLog, element: str):
    hostile = attacked(trial, asset(element), {"m.stl": STL, ".m.stl": b""})
    with pytest.raises(LogError, match=r"names the file '.*', which is not attached"):
        robot_of(hostile)


@pytest.mark.parametrize(
    ("mjcf", "match"),
    [
        (top('<include file="/etc/passwd"/>'), r"has <include> \('/etc/passwd'\), which reads"),
        (asset('<model name="a" file="/etc/passwd"/>'), r"<model> \('/etc/passwd'\)"),
        (within("</worldbody>", '<attach model="a"/>'), "has <attach>, which reads another"),
        (top('<extension><plugin plugin="a.b"/></extension>'), "has <extension>, which runs"),
        (within("</sensor>", '<plugin plugin="a.b"/>'), r"has <plugin> \('a\.b'\), which runs"),
        ('<robot name="r"><link name="a"/></robot>', "expected a model in <mujoco>, got <robot>"),
        ("<!DOCTYPE mujoco><mujoco/>", "has a <!DOCTYPE>"),
        ('<!DOCTYPE m SYSTEM "file:///etc/passwd"><mujoco/>', "has a <!DOCTYPE>"),
        ('<!DOCTYPE m [<!ENTITY a "b"><!ENTITY c "&a;&a;">]><mujoco/>', "has a <!DOCTYPE>"),
        ("<mujoco>&file;</mujoco>", "no XML: undefined entity"),
        ('<m:mujoco xmlns:m="x"/>', "expected a model in <mujoco>"),
        ("", "no XML"),
        ("\0", "no XML"),
        (top("<body>" * 250 + "</body>" * 250), "200 elements within each other"),
        (top("<!--" + "x" * 2**21 + "-->"), "characters, more than 2000000"),
        (asset('<mesh name="m" file="m.stl" content_type="application/zip"/>'), "content type"),
        (MJCF.replace("<option ", '<option iterations="10001" '), "has iterations=10001"),
        (MJCF.replace('timestep="0.005"', 'timestep="0"'), "must be above 0 s"),
        (MJCF.replace('timestep="0.005"', 'timestep="nan"'), "must be above 0 s"),
        (MJCF.replace('timestep="0.005"', 'timestep="1e-10"'), "takes 1e.08 physics steps"),
        (
            MJCF.replace('name="torso"', 'name="' + "t" * 1000 + '"'),
            "is of another robot than its messages",
        ),
        (MJCF.replace("<geom type", '<geom mass="0" type'), "must be larger than mjMINVAL"),
        (
            mesh("m.stl")
            .replace("<compiler", "<")
            .replace("<asset", '<compiler meshdir="/etc"/><asset'),
            "in the folder '/etc'",
        ),
    ],
)
def test_what_a_model_in_a_log_may_not_ask_for_is_refused_by_name(
    trial: TrialLog, mjcf: str, match: str
):
    with pytest.raises(LogError, match=match) as caught:
        robot_of(attacked(trial, mjcf, {"m.stl": STL}))
    assert len(str(caught.value)) < 4000


@pytest.mark.parametrize(
    ("file", "data", "match"),
    [
        ("m.stl", b"", "is empty"),
        ("m.stl", STL[:-7], "wrong size"),
        ("m.stl", bytes(80) + b"\xff" * 204, "number of faces"),
        ("m.stl", bytes(80) + struct.pack("<I", 4) + b"\xff" * 200, "not finite"),
        ("m.obj", OBJ + b"f 1 2 9999999\n", "does not exist"),
        ("m.obj", OBJ + b"f -1 -2 -9999\n", "could not parse"),
        ("m.msh", struct.pack("<4i", -1, -1, -1, -1), "invalid sizes"),
        ("m.msh", struct.pack("<4i", 2**30, 0, 0, 2**30), "too large sizes"),
        ("m.zip", b"PK", r"a model in a log may name \.stl"),
        ("m.mjz", b"PK", r"a model in a log may name \.stl"),
        ("m.xml", b"<mujoco/>", r"a model in a log may name \.stl"),
    ],
)
def test_a_damaged_or_unknown_mesh_is_refused(trial: TrialLog, file: str, data: bytes, match: str):
    with pytest.raises(LogError, match=match):
        robot_of(attacked(trial, mesh(file), {file: data}))


def test_a_failure_of_the_child_process_is_not_blamed_on_the_log(
    trial: TrialLog, monkeypatch: pytest.MonkeyPatch
):
    def ended(*_: object) -> None:
        raise WorkError("the process ended unexpectedly")

    monkeypatch.setattr(robots, "check_compiles", ended)
    with pytest.raises(WorkError, match=r"^the process ended unexpectedly$"):
        robot_of(trial)
