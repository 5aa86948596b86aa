"""One process of a campaign: makes and judges cases, and keeps the findings."""

import faulthandler
import gc
import os
import resource
import signal
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from shutil import copytree, rmtree

import numpy as np

from tests.fuzz.oracle import Verdict, captured, innermost, judge
from tests.fuzz.target import Make, Target

ADDRESS_SPACE = 2 * 2**30
"""Largest growth of the address space of a batch, bytes: a case that takes more ends with a
MemoryError, or with its process."""

KEPT = 3
"""Findings of one cause whose files are kept."""


@dataclass(frozen=True)
class Player:
    """Maker and judge of the cases of one target.

    Attributes:
        target: The target.
        make: Maker of its cases.
        seed: Seed of all cases.
        work: Folder for the cases.
        failures: Folder of the findings, made with the first one.
    """

    target: Target
    make: Make
    seed: int
    work: Path
    failures: Path

    def run(self, numbers: Iterable[int], sender: Connection) -> None:
        """Runs cases in this process, which is limited for the rest of its life.

        Args:
            numbers: Numbers of the cases.
            sender: Receives a verdict for each case.
        """
        gc.freeze()  # freed during a case, garbage of the parent would hide growth of its memory
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        limit = pages * resource.getpagesize() + ADDRESS_SPACE
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        output = self._output(os.getpid())
        with captured(output) as file:
            faulthandler.enable(file, all_threads=False)
            faulthandler.register(signal.SIGPROF, file, all_threads=False, chain=True)
            for number in numbers:
                sender.send(self._play(number, output))
        output.unlink()

    def death(self, number: int, process: int, status: int) -> Verdict:
        """Keeps and returns the finding of a case that ended its process.

        Args:
            number: Number of the case.
            process: Number of the process.
            status: Its exit status; negative for a signal.
        """
        name = signal.Signals(-status).name if status < 0 else f"status {status}"
        output = self._output(process)
        trace = output.read_text(errors="replace") if output.exists() else ""
        output.unlink(missing_ok=True)
        problem, place = f"its process ended with {name}\n{trace}", f"{name}-{innermost(trace)}"
        verdict = Verdict("", problem, place, 0.0, 0.0)
        self._folder(number).mkdir(exist_ok=True)  # it ended before there was one
        self._keep(number, verdict)
        return verdict

    def _play(self, number: int, output: Path) -> Verdict:
        entropy = [self.seed, zlib.crc32(self.target.name.encode()), number]
        case = self.make(np.random.default_rng(entropy))
        self._folder(number).mkdir()
        self._note(number).write_text(case.what, encoding="utf-8", errors="backslashreplace")
        verdict = judge(case, self._folder(number), output)
        if verdict.problem:
            self._keep(number, verdict)
        self._note(number).unlink()
        return verdict

    def _folder(self, number: int) -> Path:
        return self.work / f"{self.target.name}-{number}"

    def _note(self, number: int) -> Path:
        """File with the description of a case."""
        return self._folder(number).with_suffix(".txt")

    def _output(self, process: int) -> Path:
        return self.work / f"output-{process}"

    def _keep(self, number: int, verdict: Verdict) -> None:
        """Moves the files of a finding, with its report and the command that repeats it."""
        os.chdir(self.work)
        folder, note = self._folder(number), self._note(number)
        place = self.failures / self.target.name / verdict.place
        if not place.exists() or len(list(place.iterdir())) < KEPT:
            kept = place / str(number)
            rmtree(kept, ignore_errors=True)
            copytree(folder, kept / "files", symlinks=True)
            what = note.read_text(encoding="utf-8") if note.exists() else "none was made"
            (kept / "report.txt").write_text(
                f"python -m tests.fuzz --only {self.target.name} --seed {self.seed} "
                f"--first {number} --count 1\n\n{what}\n\n{verdict.problem}\n",
                encoding="utf-8",
                errors="backslashreplace",
            )
        rmtree(folder)
