"""The running server: who is let in, what it withstands, and how it stops."""

import http.client
import json
import os
import random
import signal
import socket
import subprocess
import time
import tty
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

import surrogate
from surrogate.live import messages
from surrogate.live.moments import Moment
from surrogate.live.serve import Show, serve
from touchcal.csv_numbers import write_numbers

websockets = pytest.importorskip("websockets.sync.client")
Start = Callable[..., tuple[subprocess.Popen[str], str]]
PRESS = {"x_mm": 20.0, "y_mm": -10.0, "diameter_mm": 14.0, "force_N": 1.0, "noise_mV": 0.001, "drift_mV_per_min": 0.0,
         "sent_ms": 1.0}


def asked(address: str, path: str = "", method: str = "GET", **headers: str) -> http.client.HTTPResponse:
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.netloc, timeout=60)
    connection.request(method, path or parts.path, headers=headers)
    return connection.getresponse()


def connected(address: str, origin: str | None = None):
    parts = urlsplit(address)
    return websockets.connect(f"ws://{parts.netloc}{parts.path}frames", origin=origin or f"http://{parts.netloc}",
                              open_timeout=60)


def status(address: str, origin: str | None) -> int:
    """Status that refuses a websocket."""
    from websockets.exceptions import InvalidStatus

    parts = urlsplit(address)
    with (pytest.raises(InvalidStatus) as refused,
          websockets.connect(f"ws://{parts.netloc}{parts.path}frames", origin=origin, open_timeout=60)):
        pass
    return refused.value.response.status_code


def pressed(connection, press: dict = PRESS) -> dict:
    """The first frame that answers a press and reads it."""
    connection.send(json.dumps(press))
    for _ in range(500):
        frame = json.loads(connection.recv(timeout=60))
        if frame.get("read") and frame["true"] and frame["true"]["x_mm"] == press["x_mm"]:
            return frame
    raise AssertionError("no frame reads the press")


def test_the_page_is_served_with_a_strict_policy(address: str) -> None:
    page = asked(address)
    assert page.status == 200
    assert b"<canvas" in page.read()
    assert "script-src 'self'" in str(page.getheader("content-security-policy"))
    assert (page.getheader("cache-control"), page.getheader("referrer-policy")) == ("no-store", "no-referrer")
    assert asked(address, urlsplit(address).path + "page.js").status == 200


def test_frames_do_not_wait_until_the_one_before_is_acknowledged(monkeypatch: pytest.MonkeyPatch) -> None:
    uvicorn, at_once = pytest.importorskip("uvicorn"), []

    def accepting(server, sockets: list[socket.socket]) -> None:
        with socket.create_connection(sockets[0].getsockname()), sockets[0].accept()[0] as accepted:
            at_once.append(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))

    monkeypatch.setattr(uvicorn.Server, "run", accepting)
    serve(Show({}, iter(()), lambda moment: None, []), say=lambda address: None)
    assert at_once == [1]


def test_only_this_machine_is_listened_to(address: str) -> None:
    assert urlsplit(address).hostname == "127.0.0.1"


def test_foreign_hosts_origins_and_missing_tokens_get_403(address: str) -> None:
    assert asked(address, Host="evil.example").status == 403
    assert asked(address, Origin="http://evil.example").status == 403
    assert asked(address, "/").status == 403
    assert asked(address, "/page.js").status == 403
    token = urlsplit(address).path[1:]
    assert asked(address, f"/{'y' if token[0] == 'x' else 'x'}{token[1:]}").status == 403
    assert asked(address, method="POST").status == 403
    assert asked(address, urlsplit(address).path + "../serve.py").status in (403, 404)
    assert status(address, "http://evil.example") == 403
    assert status(address, None) == 403
    assert status(address.replace(urlsplit(address).path, "/none/"), f"http://{urlsplit(address).netloc}") == 403


def test_a_press_is_read(address: str) -> None:
    with connected(address) as connection:
        assert json.loads(connection.recv())["source"] == "learned"
        frame = pressed(connection)
        assert (frame["read"]["x_mm"], frame["read"]["y_mm"]) == pytest.approx((20.0, -10.0), abs=0.2)


@pytest.mark.thorough
def test_what_is_pressed_is_lifted_when_the_browser_goes_away(address: str) -> None:
    with connected(address) as connection:
        pressed(connection)
    with connected(address) as connection:
        connection.recv()
        frames = [json.loads(connection.recv(timeout=60)) for _ in range(100)]
    assert frames[-1]["true"] is None


def test_who_only_watched_leaves_the_press_of_another(address: str) -> None:
    with connected(address) as connection:
        pressed(connection)
        with connected(address) as other:
            other.recv()
            other.send("no press")
        frames = [json.loads(connection.recv(timeout=60)) for _ in range(50)]
    assert frames[-1]["true"] is not None


def test_five_thousand_malformed_messages_do_not_end_the_server(address: str) -> None:
    rng = random.Random(1)

    def malformed() -> str | bytes:
        broken = json.dumps({key: rng.choice([value, "1", None, [], 1e400, -1e308, {}, True]) for key, value in
                             PRESS.items() if rng.random() < 0.8})
        return rng.choice([broken, broken[:rng.randrange(len(broken) + 1)], "[" * rng.randrange(900),
                           "".join(chr(rng.randrange(1, 0xD7FF)) for _ in range(rng.randrange(200))),
                           json.dumps(rng.choice([1, "a", None, [1, 2], {"a": {}}]))])

    with connected(address) as connection:
        for _ in range(5000):
            connection.send(malformed())
        pressed(connection)
    for odd in (b"\x00\xff" * 40, "x" * 100_000):  # bytes, and too much: this browser is cut off, nobody else
        with connected(address) as connection:
            connection.send(odd)
    with connected(address) as connection:
        pressed(connection, PRESS | {"x_mm": -5.0})


@pytest.mark.slow
def test_ctrl_c_stops_it_without_a_traceback(start: Start, live_folder: Path) -> None:
    process, address = start(live_folder)
    with connected(address) as connection:
        connection.recv()
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
    assert process.stderr is not None
    assert "Traceback" not in process.stderr.read()


@pytest.mark.thorough
def test_a_recording_is_shown_and_read(start: Start, inner_model: surrogate.Model, live_folder: Path,
                                       tmp_path: Path) -> None:
    rng, signal_V, target = np.random.default_rng(1), *touch_of(inner_model)
    frames = inner_model.baseline_V + np.outer(np.arange(60) >= 40, signal_V) + rng.normal(0, 1e-6, (60, 208))
    write_numbers(tmp_path / "frames.csv", [f"v_{k:03d}" for k in range(208)], frames)
    _, address = start(live_folder, "--replay", tmp_path / "frames.csv")
    with connected(address) as connection:
        assert json.loads(connection.recv())["limits"] is None
        frame = last_read(connection, "the recording ended; ")
    assert frame["true"] is None
    assert (frame["read"]["x_mm"], frame["read"]["y_mm"]) == pytest.approx(target[:2], abs=0.2)


@pytest.mark.thorough
def test_lines_of_a_device_are_shown_and_read(start: Start, inner_model: surrogate.Model, live_folder: Path) -> None:
    signal_V, target = touch_of(inner_model)
    process, address = start(live_folder, "-", "--noise-V", "1e-6", stdin=subprocess.PIPE)
    assert process.stdin is not None
    with connected(address) as connection:
        connection.recv()
        for volts in [inner_model.baseline_V, "no frame", *[inner_model.baseline_V + signal_V] * 4]:
            process.stdin.write((volts if isinstance(volts, str) else ",".join(map(repr, volts.tolist()))) + "\n")
        process.stdin.close()
        frame = last_read(connection)
    assert (frame["read"]["x_mm"], frame["read"]["y_mm"]) == pytest.approx(target[:2], abs=0.2)


def test_a_line_that_is_no_frame_is_said_as_that_alone(inner_model: surrogate.Model) -> None:
    none = np.full(len(inner_model.baseline_V), np.nan)
    hello = messages.hello(inner_model, None, "streamed")
    assert hello["assumes"].startswith("one punch, profile flat")
    tracker = surrogate.Tracker(inner_model, inner_model.baseline_V, noise_V=1e-6)
    cut, dead = (json.loads(messages.frame(1, Moment(0.0, none, note=note), tracker.update(none), hello, "", 0.0))
                 for note in ("unreadable: 3 columns", "frame 1 of 2"))
    assert (cut["flag"], cut["note"]) == ("", "unreadable: 3 columns")
    assert "208 of 208 readings are dead" in dead["flag"]


@pytest.mark.thorough
def test_a_serial_port_is_shown_until_it_is_unplugged(start: Start, inner_model: surrogate.Model, live_folder: Path
                                                      ) -> None:
    pytest.importorskip("serial")
    signal_V, target = touch_of(inner_model)
    device, port = os.openpty()
    tty.setraw(port)
    _, address = start(live_folder, f"serial:{os.ttyname(port)}", "--noise-V", "1e-6")
    os.close(port)
    with connected(address) as connection:
        connection.recv()
        os.write(device, b"skin board 1.0\r\n")
        for volts in [inner_model.baseline_V, *[inner_model.baseline_V + signal_V] * 4]:
            os.write(device, f"{','.join(map(repr, volts.tolist()))}\r\n".encode())
        time.sleep(1.0)
        os.close(device)
        frame = last_read(connection, "stopped: serial port ")
    assert (frame["read"]["x_mm"], frame["read"]["y_mm"]) == pytest.approx(target[:2], abs=0.2)


def touch_of(model: surrogate.Model) -> tuple[np.ndarray, np.ndarray]:
    """Signal and target of a validation row, of the strongest signal."""
    k = int(np.argmax(np.linalg.norm(model.calibration.signal_V, axis=1)))
    return model.calibration.signal_V[k], model.calibration.target[k]


def last_read(connection, end: str = "the input ended") -> dict:
    """The last frame with a touch before the note that begins so."""
    read: dict = {}
    for _ in range(2000):
        frame = json.loads(connection.recv(timeout=30))
        read = frame if frame.get("read") else read
        if frame["note"].startswith(end):
            return read
    raise AssertionError("the input does not end")
