"""Tests of Rerun's viewer: opened where there is a display, and named where it is missing."""

import os
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from selfmodel.cli.viewing import rerun_view
from selfmodel.cli.viewing.rerun_view import (
    HOST,
    check_display,
    import_rerun,
    is_grpc_server,
    is_listening,
    open_viewer,
)
from selfmodel.errors import InputError, WorkError


def opened(monkeypatch: pytest.MonkeyPatch, end: str = "") -> list[str]:
    """What is done to open a viewer that runs already, and which may end early."""
    done: list[str] = []

    def flush(timeout_sec: float) -> None:
        assert 0 < timeout_sec < 1000
        if end:
            raise RuntimeError(end)
        done.append("flush")

    stream = SimpleNamespace(connect_grpc=done.append, flush=flush)
    module: Any = SimpleNamespace(RecordingStream=lambda _name: stream)
    monkeypatch.setattr(rerun_view, "import_rerun", lambda: module)
    monkeypatch.setattr(rerun_view, "is_grpc_server", lambda _port: True)
    monkeypatch.setenv("DISPLAY", ":0")
    with socket.create_server((HOST, 0)) as viewer:
        port = viewer.getsockname()[1]
        open_viewer(lambda _recording: done.append("fill"), port)
    return [step.replace(str(port), "PORT") for step in done]


def free_port() -> int:
    with socket.create_server((HOST, 0)) as server:
        return server.getsockname()[1]


def test_a_viewer_that_runs_shows_the_recording_too(monkeypatch: pytest.MonkeyPatch):
    assert opened(monkeypatch) == ["rerun+http://127.0.0.1:PORT/proxy", "fill", "flush"]


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"])
def test_another_program_on_the_port_is_an_error_that_names_the_option(
    monkeypatch: pytest.MonkeyPatch, answer: bytes
):
    stream: Any = SimpleNamespace(RecordingStream=lambda _name: None)
    monkeypatch.setattr(rerun_view, "import_rerun", lambda: stream)
    monkeypatch.setenv("DISPLAY", ":0")
    with answering(answer) as port, pytest.raises(WorkError, match=f"port {port} .* --port N"):
        open_viewer(lambda _recording: pytest.fail("sent"), port)


def test_a_server_of_http_2_may_be_rerun():
    with answering(b"\0\0\x12\x04" + bytes(23)) as port:
        assert is_grpc_server(port)


@contextmanager
def answering(answer: bytes) -> Iterator[int]:
    """The port of a server that answers each client with these bytes and hangs up."""

    def serve() -> None:
        with suppress(OSError):  # it was closed
            while True:
                client, _ = server.accept()
                with client, suppress(OSError):
                    client.sendall(answer)
                    client.shutdown(socket.SHUT_WR)
                    client.recv(100)

    with socket.create_server((HOST, 0)) as server:
        thread = Thread(target=serve)
        thread.start()
        try:
            yield server.getsockname()[1]
        finally:
            server.shutdown(socket.SHUT_RDWR)
            thread.join()


def test_a_viewer_keeps_no_output_of_the_command_open(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    told = tmp_path / "told"
    devices = "str([os.fstat(number).st_rdev for number in (1, 2)])"
    look = f"import os; open({str(told)!r}, 'w').write({devices})"
    monkeypatch.setattr(rerun_view, "viewer_command", lambda _port: [sys.executable, "-Sc", look])
    stream: Any = SimpleNamespace(RecordingStream=lambda _name: None)
    monkeypatch.setattr(rerun_view, "import_rerun", lambda: stream)
    monkeypatch.setenv("DISPLAY", ":0")

    with pytest.raises(WorkError, match="it ended with status 0"):
        open_viewer(lambda _recording: None, free_port())

    assert told.read_text() == str([Path(os.devnull).stat().st_rdev] * 2)


@pytest.mark.process
@pytest.mark.filterwarnings("ignore:subprocess .* is still running:ResourceWarning")  # it goes on
@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
def test_a_viewer_listens_on_this_computer_alone_before_the_data_are_sent(
    monkeypatch: pytest.MonkeyPatch,
):
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    port = free_port()
    # The same command without a window.
    command = [*rerun_view.viewer_command(port), "--serve-grpc"]
    monkeypatch.setattr(rerun_view, "viewer_command", lambda _port: command)
    monkeypatch.setenv("DISPLAY", ":0")
    reached = []
    try:
        open_viewer(
            lambda _recording: reached.extend(
                (*(is_listening(port, host) for host in (HOST, "127.0.0.2")), is_grpc_server(port))
            ),
            port,
        )
    finally:
        end(command[4:])

    assert reached == [True, False, True]


def end(arguments: list[str]) -> None:
    """Ends the processes with these arguments: the viewer, and the command that started it."""
    last = "\0".join(arguments).encode() + b"\0"
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if path.read_bytes().endswith(last):
                os.kill(int(path.parent.name), signal.SIGKILL)


def test_a_viewer_that_does_not_start_is_an_error(monkeypatch: pytest.MonkeyPatch):
    failing = [sys.executable, "-S", "-c", "raise SystemExit(3)"]
    monkeypatch.setattr(rerun_view, "viewer_command", lambda _port: failing)
    stream: Any = SimpleNamespace(RecordingStream=lambda _name: None)
    monkeypatch.setattr(rerun_view, "import_rerun", lambda: stream)
    monkeypatch.setenv("DISPLAY", ":0")

    with pytest.raises(WorkError, match="did not start: it ended with status 3; write a file"):
        open_viewer(lambda _recording: None, free_port())


def test_a_viewer_that_ends_early_is_an_error_that_names_the_file_to_write(
    monkeypatch: pytest.MonkeyPatch,
):
    with pytest.raises(WorkError, match=r"ended before .*: severed; write a file with -o NAME"):
        opened(monkeypatch, end="severed")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems always have a display")
def test_without_a_display_the_error_names_the_file_to_write():
    with pytest.raises(InputError, match=r"write a file with -o NAME\.rrd"):
        check_display({})
    check_display({"WAYLAND_DISPLAY": "wayland-0"})


def test_a_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "rerun", None)

    with pytest.raises(InputError, match=r"pip install 'selfmodel\[rerun\]'"):
        import_rerun()
