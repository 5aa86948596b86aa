"""A study as a TOML file, whose keys are the arguments of the function that plans it."""

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from selfmodel.errors import InputError, check_name, check_type
from selfmodel.files import load_toml, path_of, read_file
from selfmodel.settings import RepairSettings, Settings
from selfmodel.studies import plans
from selfmodel.studies.study import Study

PLANS: Mapping[str, Callable[..., Study]] = MappingProxyType(
    {"ablation": plans.ablation, "suite": plans.suite, "paper": plans.paper}
)
"""Functions that plan a study, by the value of the key ``study``."""

TABLES: Mapping[str, type[Settings | RepairSettings]] = MappingProxyType(
    {"settings": Settings, "repair_settings": RepairSettings}
)
"""Keys with a table, and what it gives."""

MAX_BYTES = 2**20
"""Largest size of a file that is read, bytes."""


def read_study(path: str | Path) -> Study:
    """Returns the study that a TOML file defines, as ``selfmodel study`` runs it.

    The keys are ``study`` (``ablation``, ``suite`` or ``paper``) and the arguments of that
    function, ``folder`` among them; paths are relative to the current folder. A ``population``
    without ``survivors`` and ``crossovers`` has the paper's proportions. The file is kept in the
    folder as it is, where it is ``study.toml``.

    Example::

        study = selfmodel.studies.read_study("dtw.toml")
        study.run(workers=2, on_event=print)

    Raises:
        InputError: The file is missing or no TOML, or a key is unknown, missing, or has a value
            that is not one of its argument.
    """
    path = path_of(path, "a study, such as dtw.toml")
    data = read_file(path, "a study, such as dtw.toml", MAX_BYTES)
    try:
        keys = load_toml(data.decode("utf-8-sig"))
    except ValueError as error:
        raise InputError(f"{path}: expected a study in TOML, got {error}") from error
    try:
        return dataclasses.replace(_planned(keys), definition=data)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _planned(keys: dict[str, Any]) -> Study:
    for key, example in (("study", "ablation"), ("folder", "runs/dtw")):
        if key not in keys:
            raise InputError(f'expected the key {key}, got none: add {key} = "{example}"')
    check_name("study", name := keys.pop("study"), PLANS)
    known = inspect.signature(PLANS[name]).parameters
    for key in keys:
        check_name(f"key of the study {name}", key, known)
    return PLANS[name](**keys | {key: _settings(key, keys[key]) for key in TABLES if key in keys})


def _settings(key: str, table: Any) -> Settings | RepairSettings:  # noqa: ANN401  # of any TOML type
    """Returns the settings of a table, as ``--population`` scales them."""
    check_type(table, dict, f"a table [{key}] with keys such as population = 60")
    made = TABLES[key]
    names = [field.name for field in dataclasses.fields(made)]
    for name in table:
        check_name(f"key of [{key}]", name, names)
    if table.keys() & {"survivors", "crossovers"} or "population" not in table:
        return made(**table)
    rest = {name: value for name, value in table.items() if name != "population"}
    return made(**rest).scaled(table["population"])
