"""TOML from any source is read in linear time, or refused in a sentence."""

from pathlib import Path

import pytest

from selfmodel.files import load_toml, read_file


def test_tables_are_read_as_tomllib_reads_them():
    assert load_toml('a.b = 1\n[c]\n"d.e" = [0xff, -5, 1.5]') == {
        "a": {"b": 1},
        "c": {"d.e": [255, -5, 1.5]},
    }


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("a = 1\nb = " + "9" * 5000, r"an integer has more than 64 bits \(at line 2, column 5\)"),
        ("a = [0x" + "f" * 5000 + "]", r"an integer has more than 64 bits \(at line 1, column 6\)"),
        ("a = 9223372036854775808", "an integer has more than 64 bits"),
        ("\n" + ".".join("a" * 300_000) + " = 1", r"more than 16 keys .* \(at line 2, column 1\)"),
        ("a = {" + " . ".join(["b", '"c.d"'] * 9) + " = 1}", "more than 16 keys"),
        ("a = " + "[" * 10**5, "nested too deeply"),
        ("a = [1", "Unclosed array"),
    ],
    ids=lambda text: text[:12],
)
def test_what_is_not_toml_or_takes_too_long_is_refused(text: str, match: str):
    with pytest.raises(ValueError, match=match) as caught:
        load_toml(text)
    assert len(str(caught.value)) < 200


def test_a_limit_far_above_the_size_of_a_file_takes_no_memory(tmp_path: Path):
    path = tmp_path / "file"
    path.write_bytes(b"content")

    assert read_file(path, "a file", 10**18) == b"content"
