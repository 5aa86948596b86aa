"""Mutations of JSON: values of other types, extreme numbers, missing and new keys, nesting."""

import copy
import json
from typing import Any

import numpy as np

from tests.fuzz.mutate import data as raw
from tests.fuzz.mutate.numbers import near, number, text

DEPTHS = (3, 60, 1500, 20_000)


def mutated(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns JSON with one to three mutations, and their names."""
    if rng.random() < 0.15:
        return raw.mutated(data, rng)
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):  # an earlier mutation
        return raw.mutated(data, rng)
    names = []
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        value, name = changed(value, rng)
        names.append(name)
    made = json.dumps(value)
    if rng.random() < 0.05:
        depth = DEPTHS[rng.integers(len(DEPTHS))]
        mark = json.dumps("@")
        value, name = changed(value, rng, new="@")
        made = json.dumps(value).replace(mark, "[" * depth + "]" * depth, 1)
        names.append(f"{name} nested {depth}")
    return made.encode(), ", ".join(names)


def changed(value: Any, rng: np.random.Generator, new: object = None) -> tuple[Any, str]:
    """Returns a JSON value with one change somewhere within, and a description of it."""
    root = [copy.deepcopy(value)]
    places = list(_places(root, ""))
    holder, key, path = places[rng.integers(len(places))]
    if new is not None:
        holder[key] = new
        return root[0], f"{path} set"
    kind = int(rng.integers(8))
    held = holder[key]
    if kind == 0 and path:
        del holder[key]
        return (root[0] if root else None), f"{path} removed"
    if kind == 1 and isinstance(holder, dict):
        holder[text(rng)] = holder.pop(key)
        return root[0], f"{path} renamed"
    if kind == 2 and isinstance(held, (list, dict)) and held:
        if isinstance(held, list):
            held.append(held[rng.integers(len(held))])
        else:
            held[text(rng)] = any_value(rng)
        return root[0], f"{path} extended"
    if kind == 3:
        other, there, name = places[rng.integers(len(places))]
        holder[key] = copy.deepcopy(other[there])
        return root[0], f"{path} is {name}"
    if kind in (4, 5) and isinstance(held, (int, float)) and not isinstance(held, bool):
        holder[key] = near(held, rng) if kind == 4 else number(rng)
    else:
        holder[key] = any_value(rng)
    return root[0], f"{path} = {holder[key]!r:.60}"


def any_value(rng: np.random.Generator) -> object:
    """Returns a JSON value of any type; NaN and infinities as Python writes them."""
    kind = int(rng.integers(8))
    fixed: tuple[object, ...] = (None, True, False, [], {}, [[]], {"a": 1}, [1, "a", None])
    if kind < 3:
        return number(rng)
    if kind < 5:
        return text(rng)
    return copy.deepcopy(fixed[rng.integers(len(fixed))])


def _places(holder: Any, path: str) -> Any:
    """Container, key and path of each value within a container."""
    items = holder.items() if isinstance(holder, dict) else enumerate(holder)
    for key, value in list(items):
        inner = f"{path}/{key}" if path or isinstance(holder, dict) else ""
        yield holder, key, inner
        if isinstance(value, (dict, list)):
            yield from _places(value, inner or "/")
