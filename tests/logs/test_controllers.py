import hashlib
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.controllers.cpg import Cpg
from selfmodel.controllers.network import Network
from selfmodel.errors import InputError
from selfmodel.logs import load_controller, save_controller
from selfmodel.logs.controllers import MAX_CONTROLLER_BYTES, controller_bytes, parse_controller
from tests.logs.edits import altered

PARTS = st.lists(st.text("abc_é", min_size=1, max_size=5), max_size=5).map(tuple)


CPG = Cpg(("touch", "angle"), ("hip", "knee"), 0.02)


def controller() -> Controller:
    network = Network(("touch", "angle"), ("hip", "knee"), 3)
    return Controller(network, draw_genomes(np.random.default_rng(0), (network.weights,)))


def archive(**replaced: object) -> bytes:
    """The bytes of a controller's file with some of its arrays replaced, None for left out."""
    return altered(controller_bytes(controller()), **replaced)


def cpg(**replaced: object) -> bytes:
    """The bytes of a file of a CPG with some of its arrays replaced."""
    own = {"kind": np.array("cpg"), "hidden": None, "timestep": np.array(0.02)}
    return archive(**own | {"genome": np.zeros(9)} | replaced)


RANGE = st.tuples(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))


@st.composite
def designs(draw: st.DrawFn) -> Design:
    """Networks and CPGs of any size, with the paper's command ranges or others."""
    sensors, motors = draw(PARTS), draw(PARTS)
    some = st.lists(RANGE, min_size=len(motors), max_size=len(motors)).map(tuple)
    own = {"ranges": st.just(()) | some, "heading": st.booleans()}
    return draw(
        st.builds(Network, st.just(sensors), st.just(motors), st.integers(0, 4), **own)
        | st.builds(Cpg, st.just(sensors), st.just(motors), st.floats(1e-4, 1), **own)
    )


@given(design=designs(), seed=st.integers(0, 99))
def test_a_controller_comes_back_equal(design: Design, seed: int):
    before = Controller(design, draw_genomes(np.random.default_rng(seed), (design.weights,)))
    data = controller_bytes(before)
    assert parse_controller(data, "here") == before
    assert controller_bytes(parse_controller(data, "here")) == data


def test_a_file_of_the_paper_s_ranges_has_the_bytes_that_it_always_had():
    plain = Network(("touch", "angle"), ("hip", "knee"), 3, ranges=((0.0, np.pi / 4),) * 2)
    with zipfile.ZipFile(io.BytesIO(controller_bytes(controller()))) as file:
        names = [info.filename for info in file.infolist()]
    digest = hashlib.sha256(controller_bytes(controller())).hexdigest()

    assert names == ["kind.npy", "sensors.npy", "motors.npy", "hidden.npy", "genome.npy"]
    assert digest == "d63d2b7afbe6bd76c61499b9508b9c27fad4ce6aacdb7f758d6feb48977c7637"
    assert controller().design == plain


def test_a_controller_comes_back_from_a_file_that_any_numpy_reads(tmp_path: Path):
    path = tmp_path / "gait.npz"
    save_controller(path, controller())
    assert load_controller(path) == controller()
    with np.load(path, allow_pickle=False) as arrays:
        assert arrays["genome"].tolist() == controller().genome.tolist()
    with pytest.raises(InputError, match=r"gait\.npz exists, and is not overwritten"):
        save_controller(path, controller())


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"PK not a zip", "expected a controller"),
        (archive(genome=None), "it holds hidden, kind"),
        (archive(extra=np.zeros(1)), "it holds extra"),
        (archive(kind=np.array("tree")), "expected the kind 'network' or 'cpg' or .*, got 'tree'"),
        (archive(genome=np.zeros(9)), "got a genome of shape"),
        (archive(genome=np.full(26, 2.0)), "every weight must lie in"),
        (archive(genome=np.zeros(26, np.float32)), "expected float64"),
        (archive(genome=np.zeros((2, 13))), "its arrays have the types and ranks"),
        (archive(hidden=np.array(3.0)), "its arrays have the types and ranks"),
        (archive(hidden=np.array(-3)), "got a genome of shape"),
        (archive(sensors=np.array([None, "x"])), "Object arrays cannot be loaded"),
        (archive(genome=np.zeros(MAX_CONTROLLER_BYTES // 8)), "16777216 bytes"),
        (archive(ranges=np.ones((1, 2))), "2 motors need a command range each, got 1"),
        (archive(ranges=np.ones((2, 3))), "too many values to unpack"),
        (archive(ranges=np.ones((2, 2), np.float32)), "its ranges is float32, expected float64"),
        (archive(ranges=np.full((2, 2), np.nan)), "needs a finite command range"),
        (archive(kind=np.array("cpg")), "it holds genome, hidden"),
        (cpg(timestep=np.array(0.0)), "time step must be above 0 s"),
        (cpg(timestep=np.array(1e308)), r"at most 3600 s, got 1e\+308"),
        (cpg(timestep=np.array(1)), "its arrays have the types and ranks"),
        (cpg(genome=np.zeros(8)), "has 9 weights, got a genome of shape"),
    ],
)
def test_what_is_no_controller_is_refused(tmp_path: Path, data: bytes, match: str):
    path = tmp_path / "bad.npz"
    path.write_bytes(data)
    with pytest.raises(InputError, match=rf"bad\.npz: expected a controller.*{match}|{match}"):
        load_controller(path)


def test_a_bomb_is_not_unpacked():
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive_file:
        for name in ("kind", "sensors", "motors", "hidden", "genome"):
            archive_file.writestr(f"{name}.npy", bytes(MAX_CONTROLLER_BYTES))
    with pytest.raises(InputError, match="unpacks to more than"):
        parse_controller(file.getvalue(), "here")
