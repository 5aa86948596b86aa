"""Mutations of CSV files: other fields, separators, lines and characters."""

import numpy as np

from tests.fuzz.mutate import data as raw
from tests.fuzz.mutate.numbers import number_text, text


def mutated(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a file with one to three mutations, and their names."""
    if rng.random() < 0.2:
        return raw.mutated(data, rng)
    rows = [line.split(",") for line in data.decode().splitlines()]
    names = [_changed(rows, rng) for _ in range(int(rng.integers(1, 4)))]
    separator = str(rng.choice([",", ",", ",", ";", "\t", " ", "|"]))
    end = str(rng.choice(["\n", "\n", "\r\n", "\r", "\n\n"]))
    made = end.join(separator.join(row) for row in rows)
    if rng.random() < 0.1:
        made = made.replace(".", ",")
    encoding = str(rng.choice(["utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16"]))
    return made.encode(encoding, "replace"), f"{', '.join(names)}, {separator!r}, {end!r}"


def _changed(rows: list[list[str]], rng: np.random.Generator) -> str:
    row = rows[int(rng.integers(len(rows)))]
    if not row:
        return "nothing"
    place = int(rng.integers(len(row)))
    kind = int(rng.integers(9))
    if kind == 0:
        rows[0][int(rng.integers(len(rows[0])))] = text(rng)
    elif kind == 1:
        row[place] = number_text(rng)
    elif kind == 2:
        row[place] = text(rng)
    elif kind == 3:
        row[place] = str(
            rng.choice(["", "nan", "inf", '"', '""', '"1', "1_0", "1,5", "true", "\0"])
        )
    elif kind == 4:
        row.append(number_text(rng))
    elif kind == 5:
        del row[place]
    elif kind == 6:
        rows.remove(row) if len(rows) > 1 else row.clear()
    elif kind == 7:
        rows.insert(int(rng.integers(len(rows) + 1)), list(row))
    else:
        rng.shuffle(row)
    return f"kind {kind}"
