"""The commands that make and show a repertoire."""

import json
from pathlib import Path

from tests.helpers.command import printed, refused, succeeds

SMALL = ("--evaluations", "40", "--steps", "10", "--seed", "2")


def test_a_repertoire_is_made_and_shown(tmp_path: Path):
    done = succeeds(
        "repertoire", "make", "quadruped", "--out", "gaits.npz", *SMALL, "--json", cwd=tmp_path
    )
    made = json.loads(done.stdout)
    shown = printed("repertoire", "info", "gaits.npz", "--json", cwd=tmp_path)

    # Batches are whole.
    assert (made["robot"], made["evaluations"], made["cells"]) == ("quadruped", 200, 160_000)
    assert made.pop("simulated_steps") == 200 * 10
    assert shown == made
    assert "200 of 40 gaits evaluated" in done.stderr


def test_an_existing_file_is_not_overwritten_and_only_a_repertoire_is_shown(tmp_path: Path):
    (tmp_path / "gaits.npz").write_bytes(b"mine")
    make = ("repertoire", "make", "quadruped", "--out", "gaits.npz", *SMALL)
    refused(*make, said="gaits.npz exists, and is not overwritten", cwd=tmp_path)
    refused("repertoire", "info", "gaits.npz", said="expected a repertoire", cwd=tmp_path)

    assert (tmp_path / "gaits.npz").read_bytes() == b"mine"
