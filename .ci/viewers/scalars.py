"""Prints what Rerun would plot of an entity: one JSON line a row, with its time, names and numbers.

Usage: python scalars.py RECORDING.rrd ENTITY
"""

import json
import sys

from rerun.chunk import RrdReader


def main(recording: str, entity: str) -> None:
    """Prints the rows of the chunks that carry the archetype Scalars, in order of time."""
    rows: list[tuple[int, list[str], list[float]]] = []
    for chunk in RrdReader(recording).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path != entity or "Scalars:scalars" not in batch.schema.names:
            continue
        column = batch.column("Scalars:scalars")
        if str(column.type) != "list<item: double>":
            sys.exit(f"{entity}: expected lists of float64 as Scalars, got {column.type}")
        times = batch.column("message_log_time").cast("int64").to_pylist()
        names = batch.column("SeriesLines:names").to_pylist()
        rows += zip(times, names, column.to_pylist(), strict=True)
    rows.sort(key=lambda row: row[0])
    for time, names, numbers in rows:
        line = json.dumps({"time": time, "names": names, "numbers": numbers})
        sys.stdout.write(f"{line}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
