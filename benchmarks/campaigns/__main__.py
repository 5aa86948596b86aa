"""``python -m benchmarks.campaigns``: executors, speed and kills of a study, on a quiet machine.

``table`` runs the study on processes, on a Dask cluster of two workers on this machine, and as
submitit's local jobs, and compares the tables to the bit; ``speed`` measures one and two worker
processes; ``kills`` kills drivers, workers and schedulers on the way. With the default sizes, each
study has more than 200 cells.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

from benchmarks.campaigns.executors import NAMES, cluster, options
from benchmarks.campaigns.kills import kill_on_the_way
from benchmarks.campaigns.speed import measure
from benchmarks.campaigns.study import Size, command, start, table


def main() -> None:
    """Runs the chosen measurements and prints them as JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaigns", description=__doc__)
    parser.add_argument("what", choices=("table", "speed", "kills"))
    parser.add_argument("--seeds", type=int, default=4, help="54 cells each")
    parser.add_argument("--population", type=int, default=20)
    parser.add_argument("--generations", type=int, default=5)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--pause", default="4,12", help="shortest and longest time to a kill, s")
    parser.add_argument("--seed", type=int, default=0, help="of the kills")
    given = parser.parse_args()
    size = Size(given.seeds, given.population, given.generations, given.steps)
    shortest, longest = map(float, given.pause.split(","))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if given.what == "speed":
            found: dict[str, object] = {**measure(size, folder)}
        elif given.what == "table":
            found = _tables(size, folder)
        else:
            pause = (shortest, longest)
            found = kill_on_the_way(size, folder / "kills", given.kills, pause, given.seed)
            _run(size, folder / "unbroken", ["--workers", "2"])
            found["same_table"] = table(folder / "kills" / "out") == table(folder / "unbroken")
    print(json.dumps(found, indent=1))


def _tables(size: Size, folder: Path) -> dict[str, object]:
    """Returns wall times by executor, and whether the tables are the same to the bit."""
    seconds: dict[str, object] = {}
    with cluster(folder / "cluster") as own:
        for name in NAMES:
            chosen = options(name, own)
            begin = time.perf_counter()
            _run(size, folder / name, chosen)
            seconds[name] = time.perf_counter() - begin
    tables = [table(folder / name) for name in NAMES]
    same = all(one == tables[0] for one in tables)
    return {"seconds": seconds, "rows": len(tables[0]), "same_table": same}


def _run(size: Size, out: Path, chosen: list[str]) -> None:
    errors = out.with_name(f"{out.name}-stderr")
    if start(command(size, out, *chosen), errors).wait():
        raise SystemExit(errors.read_text()[-2000:])


if __name__ == "__main__":
    main()
