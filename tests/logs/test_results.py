"""Promises of result files: what made them is in them, and no change of their content is read."""

import json
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.logs import results
from selfmodel.logs.results import (
    MAX_BYTES,
    parse_json,
    read_result,
    result_bytes,
    verified,
    versions,
)

CONTENT = {"a": [1, 2.5, None, True, "text \u00e9\ud800"], "b": {"c": -0.0, "": "e"}}
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    # A surrogate pair in JSON is one character.
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: (
        st.dictionaries(st.text(max_size=5), inner, max_size=3) | st.lists(inner, max_size=3)
    ),
    max_leaves=8,
)


def test_a_result_file_states_the_versions_that_made_it():
    values = json.loads(result_bytes({"a": 1}))

    assert list(values) == ["a", "made_with", "sha256"]
    assert list(values["made_with"]) == ["selfmodel", "mujoco", "numpy", "cma"]
    assert values["made_with"] == versions()
    assert verified(values) == {"a": 1}


@given(st.dictionaries(st.text(max_size=5), JSON, max_size=4))
def test_content_is_read_as_it_was_written(content: dict):
    content = {key: value for key, value in content.items() if key not in ("made_with", "sha256")}

    found = verified(parse_json(result_bytes(content)))
    assert json.dumps(found) == json.dumps(content)


@given(st.sampled_from(["a", "b", "made_with"]), JSON)
def test_another_value_under_the_same_digest_is_refused(key: str, value: object):
    values = json.loads(result_bytes(CONTENT))
    if json.dumps(values[key], sort_keys=True) == json.dumps(value, sort_keys=True):
        return

    with pytest.raises(ValueError, match="digest is missing or wrong"):
        verified({**values, key: value})


def test_a_file_of_version_0_1_has_neither_key_and_is_read_as_such():
    assert verified({"a": 1}) == {"a": 1}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "Expecting value"),
        (b"[]", "it is no JSON object"),
        (b"3", "it is no JSON object"),
        (b'{"a": NaN}', "the number NaN, which is not finite"),
        (b'{"a": -Infinity}', "the number -Infinity, which is not finite"),
        (b'{"a": 1e999}', "the number 1e999, which is not finite"),
        (b'{"a": 1' + b"0" * 5000 + b"}", "Exceeds the limit"),
        (b'{"a": ' * 100_000, "nested too deeply"),
        (b"[" * 100_000, "nested too deeply"),
        (b"\xff{}", "codec can't decode"),
        ('{"a": 1}'.encode("utf-16"), "codec can't decode"),
        (b" " * (MAX_BYTES + 1), f"at most {MAX_BYTES} bytes, got more"),
    ],
    ids=range(12),
)
def test_no_result_file_is_refused_with_its_name_and_the_remedy(
    data: bytes, reason: str, tmp_path: Path
):
    path = tmp_path / "part.json"
    path.write_bytes(data)

    with pytest.raises(InputError, match=rf"part\.json: expected a part.*{reason}.*; delete it"):
        read_result(path, "a part", "delete it")


def test_a_file_that_could_not_be_read_is_not_written(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(results, "MAX_BYTES", 300)
    result_bytes({"a": "x" * 10})

    with pytest.raises(ValueError, match="expected a result of at most 300 bytes as JSON, got"):
        result_bytes({"a": "x" * 300})
    with pytest.raises(ValueError, match="not JSON compliant"):
        result_bytes({"a": float("nan")})
