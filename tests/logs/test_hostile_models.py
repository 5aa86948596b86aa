import dataclasses
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.errors import WorkError
from selfmodel.experiments.trial_logs import robot_of_logs
from selfmodel.logs import LogError, read_log, robots
from selfmodel.logs.reader import TrialLog
from selfmodel.logs.records import MODEL_FILE
from selfmodel.logs.robots import robot_of
from selfmodel.logs.verify import verify
from selfmodel.robot.mjcf.untrusted import checked_model
from selfmodel.sandbox.budget import Budget
from tests.logs.conftest import MJCF
from tests.logs.hostile import outcome
from tests.logs.test_hostile_logs import attach

TASKS = Path(__file__).parents[2] / "tasks"


@pytest.fixture
def trial(log: Path) -> TrialLog:
    return read_log(log)


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


def stl(faces: int) -> bytes:
    """Triangles whose corners all lie on a sphere, so that each is a corner of the hull."""
    corners = np.random.default_rng(0).normal(size=(faces, 3, 3))
    corners /= np.linalg.norm(corners, axis=-1, keepdims=True)
    rows = np.zeros(faces, dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows["v"] = corners
    return bytes(80) + struct.pack("<I", faces) + rows.tobytes()


def png(width: int, height: int, pixels: bytes | None = None, texts: int = 0) -> bytes:
    raw = bytes((3 * width + 1) * height) if pixels is None else pixels
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), *[(b"zTXt", b"k\0\0" + zlib.compress(b"t"))] * texts]
    chunks += [(b"IDAT", zlib.compress(raw)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.parametrize("name", ["quadruped", "hexapod"])
def test_a_checked_model_compiles_to_the_same_bytes(name: str, tmp_path: Path):
    text = (TASKS / f"{name}.xml").read_text()
    compiled = []
    for version, mjcf in enumerate((text, checked_model(text, {}).mjcf)):
        path = tmp_path / f"{version}.mjb"
        mujoco.mj_saveModel(mujoco.MjModel.from_xml_string(mjcf), str(path))
        compiled.append(path.read_bytes())
    assert compiled[0] == compiled[1]


@pytest.mark.parametrize(
    ("mjcf", "files"),
    [
        (mesh("m.stl"), {"m.stl": stl(50)}),
        (mesh("m.STL"), {"m.STL": stl(50)}),
        (mesh("m.obj"), {"m.obj": OBJ}),
        (asset('<texture name="t" type="2d" file="t.png"/>'), {"t.png": png(8, 8)}),
        (asset('<hfield name="h" size="1 1 1 1" file="h.png"/>'), {"h.png": png(8, 8)}),
        (asset('<texture name="t" builtin="gradient" width="512" height="3072"/>'), {}),
        (mesh("m.stl"), {"m.stl": stl(50), "../../etc/passwd": b"", "a\0b": b"", "\x1b[2J": b""}),
    ],
)
def test_what_is_attached_and_small_loads(trial: TrialLog, mjcf: str, files: dict[str, bytes]):
    robot = robot_of(attacked(trial, mjcf, files))
    assert set(robot.assets) <= {"m.stl", "m.STL", "m.obj", "t.png", "h.png"}


FILES = ("/etc/passwd", "../m.stl", "sub/m.stl", "file:///m.stl", "%2e%2e/m.stl", "M.STL", " m.stl")


@pytest.mark.parametrize(
    "file", [*FILES, "m.stl\n", "m.stl&#10;", "~/m.stl", "C:\\m.stl", ".m.stl"]
)
@pytest.mark.parametrize(
    "element",
    [
        '<mesh name="m" file="{}"/>',
        '<texture name="t" type="2d" file="{}"/>',
        '<texture name="t" type="cube" fileright="{}"/>',
        '<hfield name="h" size="1 1 1 1" file="{}"/>',
        '<skin name="s" file="{}"/>',
    ],
)
def test_no_file_is_read_but_those_attached(trial: TrialLog, element: str, file: str):
    hostile = attacked(trial, asset(element.format(file)), {"m.stl": stl(50), ".m.stl": b""})
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
        ("<mujoco>&file;</mujoco>", "not XML: undefined entity"),
        ('<m:mujoco xmlns:m="x"/>', "expected a model in <mujoco>"),
        ("", "not XML"),
        ("\0", "not XML"),
        (top("<body>" * 250 + "</body>" * 250), "200 elements within each other"),
        (top("<!--" + "x" * 2**21 + "-->"), "characters, more than 2083333.*--budget memory="),
        (asset('<mesh name="m" file="m.stl" content_type="application/zip"/>'), "content type"),
        (MJCF.replace("<option ", '<option iterations="10001" '), "has iterations=10001"),
        (MJCF.replace('timestep="0.005"', 'timestep="0"'), "must be above 0 s"),
        (MJCF.replace('timestep="0.005"', 'timestep="nan"'), "must be above 0 s"),
        (MJCF.replace('timestep="0.005"', 'timestep="1e-10"'), "takes 1e.08 physics steps"),
        (
            MJCF.replace('name="torso"', 'name="' + "t" * 10**6 + '"'),
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
        robot_of(attacked(trial, mjcf, {"m.stl": stl(50)}))
    assert len(str(caught.value)) < 4000


@pytest.mark.parametrize(
    ("file", "data", "match"),
    [
        ("m.stl", b"", "is empty"),
        ("m.stl", stl(50)[:-7], "wrong size"),
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


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"no picture", "MuJoCo cannot use the model"),
        (b"\x89PNG\r\n\x1a\n", "cannot be loaded"),
        (png(8, 8, b"x"), "cannot be loaded"),
        (png(8, 8)[:-20], "cannot be loaded"),
        (png(8, 8).replace(b"IDAT", b"IDOT"), "cannot be loaded"),
        (png(10_000, 10_000, b""), "cannot be loaded"),
        (png(2**31 - 1, 2**31 - 1, b""), "cannot be loaded"),
    ],
)
def test_a_damaged_picture_is_refused(trial: TrialLog, data: bytes, match: str):
    mjcf = asset('<texture name="t" type="2d" file="t.png"/>')
    with pytest.raises(LogError, match=match):
        robot_of(attacked(trial, mjcf, {"t.png": data}))


LEG = '<body><joint/><geom size="1"/></body>'
GREEDY: dict[str, str] = {
    "copies of copies": within("</worldbody>", 9 * '<replicate count="99">' + 9 * "</replicate>"),
    "a million copies": within("</worldbody>", f'<replicate count="1000000">{LEG}</replicate>'),
    "a cable": within("</worldbody>", '<composite type="cable" curve="s" count="100000 1 1"/>'),
    "a soft body": within("</worldbody>", '<flexcomp name="f" type="grid" count="400 400 400"/>'),
    "a muscle": within("</actuator>", '<muscle joint="left_hip_x" name="m"/>'),
    "a search for the lengths of tendons": top(
        '<compiler><lengthrange mode="all" inttotal="1e9" maxforce="1"/></compiler>'
    ),
    "joints": within("</worldbody>", LEG * 1001),
    "motors": within("</actuator>", '<motor joint="left_hip_y"/>' * 3000),
    "a number of keyframes": top('<size nkey="1000000"/>'),
    "numbers of each geom": top('<size nuser_geom="1000000000"/>'),
    "numbers of the user": top('<size nuserdata="2000000000"/>'),
    "a hexadecimal number": top('<size nuserdata="0x7fffffff"/>'),
    "contacts that are no number": top('<size nconmax="nan"/>'),
    "memory": top('<size memory="99999999K"/>'),
    "memory of half the budget": top('<size memory="600M"/>'),
    "a custom number": top(f'<custom><numeric name="n" size="{10**9}"/></custom>'),
    "a texture": asset('<texture name="t" type="2d" builtin="flat" width="40960" height="40960"/>'),
    "a texture of six sides": asset('<texture name="t" builtin="flat" width="20000"/>'),
    "textures": asset(
        "".join(
            f'<texture name="t{k}" type="2d" builtin="flat" width="8000" height="8000"/>'
            for k in range(9)
        )
    ),
    "a height field": asset('<hfield name="h" nrow="20000" ncol="20000" size="1 1 1 1"/>'),
    "a height field of any length": asset('<hfield name="h" nrow="2000000000" ncol="2"/>'),
    "a mesh": asset('<mesh name="m" builtin="cone" params="1000000 1"/>'),
    "readings": within("</sensor>", '<user dim="1000000000"/>'),
    "contacts in a reading": within("</sensor>", '<contact geom1="floor" num="1000000000"/>'),
    "old readings": within("</sensor>", '<clock nsample="100000000" delay="1" interp="zoh"/>'),
    "a state of a motor": within(
        "</actuator>", f'<general joint="left_hip_y" dyntype="user" actdim="{10**9}"/>'
    ),
}
"""Models that would take gigabytes or minutes, by what there is too much of."""

SHORT = Budget(time=9)
"""Half a second of processor time for a model."""


@pytest.mark.process
@pytest.mark.parametrize("much", GREEDY)
def test_a_model_that_takes_too_much_is_refused_in_one_sentence(trial: TrialLog, much: str):
    said = outcome(lambda: robot_of(attacked(trial, GREEDY[much]), SHORT)).error

    assert "its model cannot be loaded: " in said
    assert "\n" not in said
    assert len(said) < 4000


@pytest.mark.parametrize("much", ["a height field", "memory of half the budget"])
def test_the_refusal_has_the_option_that_raises_the_limit(trial: TrialLog, much: str):
    with pytest.raises(LogError, match=r"memory.*--budget memory="):
        robot_of(attacked(trial, GREEDY[much]))


def test_a_larger_budget_accepts_a_larger_model(trial: TrialLog):
    large = attacked(trial, GREEDY["memory of half the budget"])
    assert robot_of(large, Budget(memory=4 * 10**9)).model.narena > 6 * 10**8


@pytest.mark.process
@pytest.mark.parametrize(
    "data",
    [png(8, 8, bytes(10**8)), png(20_000, 20_000, bytes(10**8)), png(8, 8, texts=5)],
    ids=["more pixels than it has", "a large one", "packed texts"],
)
def test_a_picture_that_unpacks_to_much_takes_little(trial: TrialLog, data: bytes):
    mjcf = asset('<texture name="t" type="2d" file="t.png"/>')
    outcome(lambda: robot_of(attacked(trial, mjcf, {"t.png": data})))


@pytest.mark.process
@pytest.mark.parametrize(
    ("mjcf", "files"),
    [
        (mesh("m.stl"), {"m.stl": stl(40_000)}),
        (asset("".join(f'<mesh name="m{k}" file="m.stl"/>' for k in range(50))), {"m.stl": stl(9)}),
        (asset('<texture name="t" builtin="flat" width="1180" height="7080"/>'), {}),
        (asset('<hfield name="h" nrow="2896" ncol="2896" size="1 1 1 1"/>'), {}),
        (within("</sensor>", '<user dim="10000"/>' * 838), {}),
        (top("<body/>" * 20_001), {}),
        (top("<keyframe>" + "<key/>" * 20_000 + "</keyframe>"), {}),
        (within("</worldbody>", '<body><geom size="1"/></body>' * 9000), {}),
        (within("</worldbody>", "<body><freejoint/><geom size='1'/></body>" * 990), {}),
    ],
    ids=[
        "mesh",
        "meshes",
        "texture",
        "height field",
        "readings",
        "empty bodies",
        "keyframes",
        "bodies",
        "free bodies",
    ],
)
def test_a_large_model_within_the_budget_takes_little(
    trial: TrialLog, mjcf: str, files: dict[str, bytes]
):
    outcome(lambda: robot_of(attacked(trial, mjcf, files)))


def test_a_model_that_fails_leaves_no_file(
    trial: TrialLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    for mjcf in (mesh("m.stl"), MJCF.replace('pos="0 0 0.6"', 'pos="0 0 nan"')):
        outcome(lambda mjcf=mjcf: robot_of(attacked(trial, mjcf, {"m.stl": b"x" * 99})))
    assert list(folder.iterdir()) == []


def test_a_failure_of_the_child_process_is_not_blamed_on_the_log(
    trial: TrialLog, monkeypatch: pytest.MonkeyPatch
):
    def ended(*_: object) -> None:
        raise WorkError("the process ended unexpectedly")

    monkeypatch.setattr(robots, "rehearse", ended)
    with pytest.raises(WorkError, match=r"^the process ended unexpectedly$"):
        robot_of(trial)


LONG = MJCF.replace("</mujoco>", f"<!-- {'long ' * 420_000} --></mujoco>")
"""A model with more characters than the default budget allows."""


def test_verify_accepts_a_larger_model_with_a_larger_budget(log: Path):
    attach(log, MODEL_FILE, "model_sha256", LONG.encode())
    with pytest.raises(LogError, match="--budget memory="):
        verify(log)

    assert verify(log, budget=Budget(memory=3 * 10**9)).model_loaded


def test_a_larger_model_replaces_that_of_a_log_with_a_larger_budget(
    trial: TrialLog, tmp_path: Path
):
    model = tmp_path / "biped.xml"
    model.write_text(LONG)

    found = robot_of_logs([trial], str(model), Budget(memory=3 * 10**9))
    assert found.anatomy.names == trial.trial.behaviour.names
