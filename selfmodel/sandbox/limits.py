"""Limits of a process on its own memory, processor time and writes; they cannot be raised again."""

import ctypes
import os
import resource
import signal
import struct
import sys
from math import ceil
from pathlib import Path

from selfmodel.sandbox.budget import Budget

WALL_FACTOR = 10
"""Wall time per processor time after which a process ends: it may wait for other processes."""


def restrict(budget: Budget, scratch: Path) -> None:
    """Limits this process for the rest of its life.

    Where the platform has no such limit, it is left out: macOS ignores ``RLIMIT_AS``, and only
    Linux from 5.13 on has Landlock.

    Args:
        budget: Memory beyond the present address space, and processor time.
        scratch: The only folder whose files the process may create or change afterwards.
    """
    seconds = ceil(budget.file_seconds)
    used = resource.getrusage(resource.RUSAGE_SELF)
    spent = round(used.ru_utime + used.ru_stime)
    _lower(resource.RLIMIT_CPU, spent + seconds, spent + seconds + 1)  # SIGXCPU, then SIGKILL
    _lower(resource.RLIMIT_FSIZE, budget.unpacked_bytes)
    _lower(resource.RLIMIT_CORE, 0)
    if (size := address_space()) is not None:
        _lower(resource.RLIMIT_AS, size + budget.memory)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(WALL_FACTOR * seconds)
    if sys.platform == "linux":
        _restrict_writes(scratch)


def address_space(peak: str = "VmSize") -> int | None:
    """Returns the size of the address space of this process, bytes; None where unknown.

    Args:
        peak: ``VmSize`` for the present size, ``VmPeak`` for the largest so far.
    """
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    sizes = [line.split()[1] for line in lines if line.startswith(f"{peak}:")]
    return int(sizes[0]) * 1024 if sizes else None


def _lower(limit: int, soft: int, hard: int | None = None) -> None:
    present = resource.getrlimit(limit)
    most = [sys.maxsize if value == resource.RLIM_INFINITY else value for value in present]
    resource.setrlimit(limit, (min(soft, *most), min(soft if hard is None else hard, most[1])))


# Landlock: Linux, include/uapi/linux/landlock.h; the numbers of the calls are those of every
# architecture.
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION_FLAG, _PATH_BENEATH, _NO_NEW_PRIVILEGES = 1, 1, 38
_WRITE_FILE, _TRUNCATE, _REFER = 1 << 1, 1 << 14, 1 << 13
_CREATE_AND_REMOVE = sum(1 << bit for bit in range(4, 13))


def _restrict_writes(scratch: Path) -> None:
    """Forbids all changes of files outside a folder; no effect on a kernel without Landlock."""
    libc = ctypes.CDLL(None, use_errno=True)
    version = libc.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION_FLAG)
    if version < 1:
        return
    writes = _WRITE_FILE | _CREATE_AND_REMOVE
    writes |= (_REFER if version >= 2 else 0) | (_TRUNCATE if version >= 3 else 0)
    attributes = struct.pack("<Q", writes)
    rules = libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    folder = os.open(scratch, os.O_RDONLY | os.O_DIRECTORY)
    beneath = struct.pack("<Qi", writes, folder)
    try:
        done = (
            rules >= 0
            and libc.syscall(_ADD_RULE, rules, _PATH_BENEATH, beneath, 0) == 0
            and libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0) == 0
            and libc.syscall(_RESTRICT_SELF, rules, 0) == 0
        )
    finally:
        os.close(folder)
        if rules >= 0:
            os.close(rules)
    if not done:
        raise OSError(ctypes.get_errno(), "Landlock refused its rules")
