"""Rerun: its viewer is opened with a recording, or the recording is written into a file."""

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from selfmodel.errors import InputError, WorkError
from selfmodel.logs.errors import LogWriteError
from selfmodel.logs.files import replace_file

APPLICATION = "selfmodel"

HOST = "127.0.0.1"
PORT = 9876
"""Address of the viewer: Rerun's own port, on this computer alone."""

START_SECONDS = 60.0
"""Longest wait until the viewer listens; a cold start from a slow disk takes some 10 s."""
ANSWER_SECONDS = 5.0
"""Longest wait for the answer of a server on this computer."""
FLUSH_SECONDS = 60.0
"""Longest wait until the viewer has the recording: a viewer that ended never has it."""

HTTP2_BEGIN = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
"""First bytes of a client of HTTP/2, with an empty frame of settings (RFC 9113, section 3.4)."""
HTTP2_SETTINGS = 4
"""Type of the first frame of a server of HTTP/2, its fourth byte."""

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")

Fill = Callable[[Any], None]
"""Function that sends everything to a recording, a ``rerun.RecordingStream``."""


def open_viewer(fill: Fill, port: int = PORT) -> None:
    """Opens Rerun's viewer, in a process of its own, with a recording.

    A viewer that runs already shows the recording too. A new one is bound to this computer, which
    ``rerun.spawn`` cannot do: a viewer of its own listens on all network interfaces.

    Args:
        fill: Sends everything to the recording.
        port: Port of the viewer.

    Raises:
        InputError: Rerun is not installed, or there is no display.
        WorkError: Another program has the port, the viewer did not start, or was closed before it
            had the recording.
    """
    check_display()
    recording = import_rerun().RecordingStream(APPLICATION)
    if not is_listening(port):
        _start_viewer(port)
    elif not is_grpc_server(port):
        raise WorkError(
            f"port {port} of this computer is used by another program than Rerun: choose another "
            f"with --port N, or write a file with -o NAME.rrd"
        )
    recording.connect_grpc(f"rerun+http://{HOST}:{port}/proxy")
    fill(recording)
    try:
        recording.flush(timeout_sec=FLUSH_SECONDS)
    except RuntimeError as error:
        raise WorkError(
            f"Rerun's viewer ended before it had the recording, or port {port} is that of another "
            f"program: {error}; write a file with -o NAME.rrd instead"
        ) from error


def viewer_command(port: int) -> list[str]:
    """Returns the command of a viewer that listens on this computer alone."""
    # -P: a folder such as rerun_cli in the current folder is not imported.
    command = [sys.executable, "-P", "-m", "rerun_cli", "--bind", HOST, "--port", str(port)]
    # As rerun.spawn has them: the share of the memory, and no welcome before the recording.
    return [*command, "--memory-limit", "75%", "--expect-data-soon"]


def is_listening(port: int, host: str = HOST) -> bool:
    """Returns whether a program listens on a port."""
    with socket.socket() as tried:
        tried.settimeout(1.0)
        return tried.connect_ex((host, port)) == 0


def is_grpc_server(port: int) -> bool:
    """Returns whether the program on a port speaks HTTP/2, as the server of Rerun's viewer does."""
    try:
        with (
            socket.create_connection((HOST, port), ANSWER_SECONDS) as server,
            server.makefile("rb") as answer,
        ):
            server.sendall(HTTP2_BEGIN)
            return answer.read(9)[3:4] == bytes([HTTP2_SETTINGS])
    except OSError:
        return False


def _start_viewer(port: int) -> None:
    """Starts a viewer, which goes on after this process, and waits until it listens.

    Raises:
        WorkError: It did not start.
    """
    try:
        viewer = subprocess.Popen(  # noqa: S603  # Rerun's own command
            viewer_command(port),
            stdin=subprocess.DEVNULL,
            # A reader of this command's output waits for no viewer.
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except OSError as error:
        raise WorkError(f"Rerun's viewer did not start: {error.strerror}") from error
    end = monotonic() + START_SECONDS
    while not is_listening(port):
        if viewer.poll() is not None:
            raise WorkError(
                f"Rerun's viewer did not start: it ended with status {viewer.returncode}; write a "
                f"file with -o NAME.rrd instead"
            )
        if monotonic() > end:
            viewer.kill()
            viewer.wait()
            raise WorkError(f"Rerun's viewer did not listen on port {port} in {START_SECONDS:g} s")
        sleep(0.05)


def write_recording(out: Path, fill: Fill) -> int:
    """Writes a recording as a file of Rerun and returns its number of bytes.

    Args:
        out: The file.
        fill: Sends everything to the recording.

    Raises:
        InputError: Rerun is not installed.
        WorkError: The file could not be written.
    """
    recording = import_rerun().RecordingStream(APPLICATION)
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "recording.rrd"
        recording.save(part)
        fill(recording)
        recording.disconnect()  # the file is complete
        data = part.read_bytes()
    try:
        replace_file(out, data)
    except LogWriteError as error:
        raise WorkError(f"{out}: it could not be written: {error.reason}") from error
    return len(data)


def import_rerun() -> Any:  # noqa: ANN401  # an extra
    """Returns the module ``rerun``.

    Raises:
        InputError: It is not installed.
    """
    try:
        import rerun  # noqa: PLC0415  # an extra
        import rerun.blueprint  # noqa: PLC0415
    except ImportError as error:
        raise InputError(
            "Rerun is not installed: pip install 'selfmodel[rerun]' (0.8 GB on the disk)"
        ) from error
    return rerun


def check_display(environment: Mapping[str, str] = os.environ) -> None:
    """Checks that a window can be opened.

    Args:
        environment: Environment variables.

    Raises:
        InputError: This is Linux without a display.
    """
    if sys.platform == "linux" and not any(environment.get(name) for name in DISPLAYS):
        raise InputError(
            "there is no display to open Rerun on: write a file with -o NAME.rrd, and open it with "
            "`rerun NAME.rrd` where there is one"
        )
