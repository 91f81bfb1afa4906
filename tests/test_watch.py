"""The page of a run: over real HTTP, while the run goes on, on folders of any kind, and in a real browser."""

import fcntl
import http.client
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time as clock
from urllib.parse import urlencode

import alsph
import numpy as np
import pytest
from alsph import plotting
from alsph.cases import Cylinder, TaylorGreen
from alsph.errors import ConfigError, RunFolderError
from alsph.folder import reading
from alsph.folder.run_folder import RunFolder
from alsph.watching import server, watched
from conftest import SMALL
from processes import bits, command, wait_until_stepping, write_case
from synthetic import write_run

PNG = b"\x89PNG\r\n\x1a\n"
OFTEN = {"output_interval": 0.1, "surface_interval": 0.05, "flush_seconds": 0.02}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a short run."""
    path = tmp_path_factory.mktemp("runs") / "run"
    return Cylinder(**SMALL).run(path, until=0.4, output_interval=0.1, progress=False).path


@pytest.fixture
def path(made, tmp_path):
    """A copy of the folder."""
    return shutil.copytree(made, tmp_path / "run")


@pytest.fixture
def ask():
    """Return a function that asks the server of a folder, which is started when it is asked first."""
    servers = {}

    def ask(folder, target="/state", *, method="GET", host="localhost", **headers):
        if folder not in servers:
            servers[folder] = server.serve(folder, 0)
            threading.Thread(target=servers[folder].serve_forever, args=[0.01], daemon=True).start()
        connection = http.client.HTTPConnection("127.0.0.1", servers[folder].port, timeout=60)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, target, headers={"Host": host} | named)
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        return answer, json.loads(text) if target in ("/state", "/results") and answer.status == 200 else text

    yield ask
    for each in servers.values():
        each.shutdown()
        each.server_close()


def wait_for(found, seconds=60.0):
    """Return what is found in the end: answers are kept for a few times the time that they took."""
    end = clock.monotonic() + seconds
    while not (value := found()):
        assert clock.monotonic() < end, "waited in vain"
        clock.sleep(0.02)
    return value


def content(folder):
    """Return the bytes of a folder's files, and when each was changed."""
    return {file: (file.is_file() and file.read_bytes(), file.stat().st_mtime_ns) for file in sorted(folder.rglob("*"))}


def test_a_finished_run(path, ask):
    answer, state = ask(path)
    history = reading.history(path / "history.csv")
    assert answer.status == 200 and state["problems"] == [] and state["message"] == ""
    assert (state["case"], state["reynolds"], state["resolution"], state["status"]) == (
        "cylinder",
        "200",
        "8",
        "finished",
    )
    assert state["progress"]["steps"] == len(history["time"]) and state["progress"]["share"] == 1.0
    assert "left" not in state["progress"] and state["progress"]["until"] == "0.4"
    assert state["time"] == pytest.approx(history["time"], rel=1e-5)
    panels = {panel["title"]: panel for panel in state["panels"]}
    assert [*panels] == [
        "drag coefficient",
        "lift coefficient",
        "velocity divergence |∇·u| D/U",
        "iterations of a step",
        "time step ΔtU/Δx",
    ]
    assert panels["drag coefficient"]["curves"]["total"] == pytest.approx(alsph.Run(path).coefficient("x"), rel=1e-5)
    assert panels["time step ΔtU/Δx"]["curves"]["time step"] == pytest.approx(8 * history["time_step"], rel=1e-5)
    assert state["fields"] == [*plotting.FIELDS] and state["snapshot"]
    results = ask(path, "/results")[1]
    assert results["remarks"] == alsph.Run(path).remarks
    assert dict(results["rows"])["Strouhal number"].startswith("none yet: ")


def test_means_have_their_uncertainty_and_stand_in_their_window(tmp_path, ask):
    run = alsph.Run(write_run(tmp_path / "run", end=30.0))
    results = ask(run.path, "/results")[1]
    assert results["means"]["drag"] == [pytest.approx(float(run.drag.mean)), str(run.drag.mean)]
    assert "±" in results["means"]["drag"][1] and results["window"] == [run.window.start, run.window.end]
    assert dict(results["rows"])["mean drag coefficient"] == str(run.drag.mean)


def test_what_says_that_the_flow_develops_says_so_here(tmp_path, ask):
    results = ask(write_run(tmp_path / "run", end=14.0), "/results")[1]
    assert "still developing" in dict(results["rows"])["mean drag coefficient"]
    assert any(remark.startswith("still developing: ") for remark in results["remarks"])


WRITTEN = []


def _audit(event, arguments):
    """Note what is opened to be written, made, renamed or removed, and locks that are not shared."""
    if event == "open" and isinstance(arguments[0], str) and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
        WRITTEN.append(("open", arguments[0]))
    elif event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.chmod", "os.utime", "os.truncate"):
        WRITTEN.append((event, str(arguments[0])))
    elif event == "fcntl.flock" and arguments[1] & ~(fcntl.LOCK_SH | fcntl.LOCK_NB):
        WRITTEN.append((event, ""))


@pytest.mark.parametrize("status", ["finished", "running"])
def test_nothing_is_written(path, ask, status):
    info = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps(info | {"status": status}))
    for file in path.rglob("*"):
        file.chmod(0o444)
    path.chmod(0o555)
    before = content(path)
    sys.addaudithook(_audit)
    WRITTEN.clear()
    for target in ("/", "/state", "/results", "/picture?field=pressure&width=wide&ink=dark", "/nothing"):
        ask(path, target)
    assert not [each for each in WRITTEN if each[0] == "fcntl.flock" or str(path) in each[1]]
    assert content(path) == before
    path.chmod(0o755)


def test_a_run_that_is_watched_ends_with_the_same_bits(tmp_path, small, ask):
    path, file = tmp_path / "run", write_case(tmp_path / "case.toml", small, until=1000.0, threads=1, **OFTEN)
    process = command("run", file, "-o", path)
    wait_until_stepping(path, process)
    reached = []
    while len(set(reached)) < 4:
        for target in ("/results", "/picture?field=vorticity&width=narrow&ink=light", "/state"):
            answer, found = ask(path, target)
            assert answer.status == 200 or b"unreadable" in found, found
        assert not found["problems"] and len({len(found["time"]), *map(_length, found["panels"])}) == 1
        assert (found["status"], process.poll()) == ("running", None)
        reached.append(found["progress"]["steps"])
    assert reached == sorted(reached) and found["progress"]["left"] and 0 < found["progress"]["share"] < 1
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    wait_for(lambda: ask(path)[1]["status"] == "interrupted")
    until = RunFolder(path).info()["time"] + 0.05
    alsph.resume(path, until=until, progress=False)
    wait_for(lambda: ask(path)[1]["status"] == "finished")
    assert bits(path) == bits(small.run(tmp_path / "whole", until=until, threads=1, progress=False, **OFTEN).path)


def _length(panel):
    (length,) = {len(curve) for curve in panel["curves"].values()}
    return length


def test_a_killed_run_is_no_longer_said_to_go_on(tmp_path, small, ask):
    path, file = tmp_path / "run", write_case(tmp_path / "case.toml", small, until=60.0, threads=1)
    process = command("run", file, "-o", path)
    wait_until_stepping(path, process)
    assert ask(path)[1]["status"] == "running"
    process.kill()
    process.communicate()
    state = wait_for(lambda: (found := ask(path)[1])["status"] == "stopped" and found)
    assert "alsph resume" in state["message"] and "left" not in state["progress"]


def test_watching_keeps_no_run_from_its_folder(path, ask):
    """A run that begins takes the lock, at whose state each request looks."""
    info = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps(info | {"status": "running"}))
    ask(path)
    end, asked = threading.Event(), []

    def hammer():
        while not end.is_set():
            asked.append(ask(path)[0].status)

    threads = [threading.Thread(target=hammer) for _ in range(4)]
    for thread in threads:
        thread.start()
    while len(asked) < 200:
        with RunFolder(path).claimed():
            pass
    end.set()
    for thread in threads:
        thread.join()
    assert set(asked) == {200}


def later(row, steps=1):
    """A row of the history some steps later."""
    step, time, *rest = row.split(",")
    return ",".join([str(int(step) + steps), f"{float(time) + 0.01 * steps:.10g}", *rest])


def test_rows_that_are_half_written_wait(path, ask):
    steps = ask(path)[1]["progress"]["steps"]
    whole = later((path / "history.csv").read_text().splitlines()[-1])
    with (path / "history.csv").open("a") as file:
        file.write(whole[:40])
        file.flush()
        os.utime(path / "history.csv", (0, 0))
        assert wait_for(lambda: ask(path)[1])["progress"]["steps"] == steps and not ask(path)[1]["problems"]
        file.write(whole[40:] + "\n" + whole[:3])
    wait_for(lambda: ask(path)[1]["progress"]["steps"] == steps + 1)


def test_the_history_is_read_as_it_grows(tmp_path, made):
    lines = (made / "history.csv").read_bytes().splitlines(keepends=True)
    path = tmp_path / "history.csv"
    growing = reading.History(path)
    assert {name: len(column) for name, column in growing.read().items()} == {"time": 0}
    text = b"".join(lines)
    for end in (5, len(lines[0]) - 1):
        path.write_bytes(text[:end])
        with pytest.raises(RunFolderError, match="first line is cut short"):
            growing.read()
    for end in [0, *range(len(lines[0]), len(text), 97), len(text), len(text)]:
        path.write_bytes(text[:end])
        whole = text[:end][: text[:end].rfind(b"\n") + 1]
        rows = np.array([line.split(b",") for line in whole.splitlines()[1:]], dtype=float)
        found = growing.read()
        if whole:
            assert [*found] == lines[0].decode().strip().split(",")
            assert np.array_equal(np.stack([*found.values()], axis=1).reshape(rows.shape), rows, equal_nan=True)
    kept = growing.read()["time"].copy()
    before = growing.read()
    path.write_bytes(text + b"".join(later(lines[-1].decode(), steps).encode() for steps in (1, 2, 3)))
    assert len(growing.read()["time"]) == len(kept) + 3 and np.array_equal(before["time"], kept)


@pytest.mark.parametrize("begin", [0, 1, 2])
def test_a_history_that_was_cut_back_or_replaced_is_read_again(tmp_path, made, begin):
    lines = (made / "history.csv").read_bytes().splitlines(keepends=True)
    path = tmp_path / "history.csv"
    path.write_bytes(b"".join(lines[:10]))
    growing = reading.History(path)
    assert len(growing.read()["time"]) == 9
    other = [lines[0], *lines[1 + begin : 2], *lines[3 : 6 if begin == 1 else None]]
    path.write_bytes(b"".join(other))  # the same inode
    assert np.array_equal(growing.read()["step"], [int(line.split(b",")[0]) for line in other[1:]])
    path.write_text("nonsense\n1\n")
    with pytest.raises(RunFolderError, match="no column 'time'"):
        growing.read()
    path.write_bytes(b"".join(lines) + lines[-1].replace(b"0", b"x"))
    with pytest.raises(RunFolderError, match="unreadable"):
        growing.read()
    path.write_bytes(b"".join(lines))
    assert len(growing.read()["time"]) == len(lines) - 1
    path.unlink()
    assert len(growing.read()["time"]) == 0


def test_a_run_that_has_only_begun(path, tmp_path, ask):
    begun = tmp_path / "begun"
    begun.mkdir()
    shutil.copy(path / "case.toml", begun)
    answer, text = ask(begun)
    assert answer.status == 404 and b"run.json is missing" in text
    assert ask(begun, "/")[0].status == 200
    (begun / "run.json").write_text(json.dumps({"status": "starting", "case": "cylinder", "until": 5.0}))
    with RunFolder(begun).claimed():
        state = ask(begun)[1]
        assert (state["status"], state["time"], state["problems"], state["snapshot"]) == ("starting", [], [], "")
        assert state["progress"] == {"time": "0", "until": "5", "share": 0.0, "steps": 0}
        assert ask(begun, "/results")[1]["problems"] == []
        answer, text = ask(begun, "/picture?field=velocity&width=wide&ink=light")
        assert answer.status == 404 and b"no snapshot yet" in text


def test_a_folder_that_is_replaced_removed_and_made_again(path, small, ask):
    state, picture = ask(path)[1], "/picture?field=vorticity&width=wide&ink=light"
    first = ask(path, picture)[1]
    small.replace(reynolds=100).run(path, until=0.2, force=True, progress=False)
    again = wait_for(lambda: (found := ask(path)[1])["reynolds"] == "100" and found)
    assert again["progress"]["steps"] < state["progress"]["steps"] and again["snapshot"] != state["snapshot"]
    assert ask(path, picture)[1] != first
    shutil.move(path, path.with_name("moved"))
    for target in ("/state", "/results", picture):
        answer, text = ask(path, target)
        assert answer.status == 404 and b"no such run folder" in text
    assert ask(path, "/")[0].status == 200
    path.mkdir()
    assert b"case.toml is missing" in ask(path)[1]
    path.rmdir()
    shutil.move(path.with_name("moved"), path)
    assert ask(path)[1]["reynolds"] == "100"


def test_what_is_no_run_folder_is_refused(tmp_path, alsph):
    (tmp_path / "thesis.tex").touch()
    for path, message in ((tmp_path, "not a run folder"), (tmp_path / "missing", "no such run folder")):
        code, stdout, stderr = alsph("watch", path, "--no-browser")
        assert (code, stdout) == (2, "") and message in stderr and stderr.count("\n") == 1


@pytest.mark.parametrize("damage", [b"", b"\x00\xff" * 500, b"1,2,3\n", b"[]"])
@pytest.mark.parametrize("name", ["case.toml", "run.json", "history.csv", "surface.h5", "particles.vtkhdf"])
def test_damage_to_a_file_costs_what_is_in_it(path, ask, name, damage):
    (path / name).write_bytes(damage)
    answer, state = ask(path)
    assert ask(path, "/")[0].status == 200
    assert ask(path, "/results")[0].status == (404 if name in ("case.toml", "run.json") else 200)
    if name in ("case.toml", "run.json"):
        assert answer.status == 404 and name.encode() in state
        return
    assert answer.status == 200 and state["status"] == "finished"
    unreadable = name == "history.csv" and damage != b""
    for found in (state, ask(path, "/results")[1]):
        assert ("history.csv" in " ".join(found["problems"])) == unreadable
    picture, text = ask(path, "/picture?field=vorticity&width=wide&ink=light")
    assert picture.status == (404 if name == "particles.vtkhdf" else 200)
    assert name != "particles.vtkhdf" or b"particles.vtkhdf" in text


def test_what_no_json_holds_is_left_out(path, ask):
    lines = (path / "history.csv").read_text().splitlines()
    row = lines[-1].split(",")
    row[lines[0].split(",").index("divergence_max")] = "inf"
    row[lines[0].split(",").index("cylinder_pressure_force_x")] = "nan"
    (path / "history.csv").write_text("\n".join([*lines[:-1], ",".join(row), ""]))
    info = json.loads((path / "run.json").read_text())
    for odd in (
        {"seconds": float("nan")},
        {"until": float("inf")},
        {"time": float("nan")},
        {"until": "x"},
        {"until": 0},
    ):
        (path / "run.json").write_text(json.dumps(info | odd))
        answer, state = ask(path)
        assert answer.status == 200, state
    assert state["panels"][2]["curves"]["largest"][-1] is None
    assert state["panels"][0]["curves"]["total"][-1] is None and state["panels"][0]["curves"]["viscous"][-1]


def test_an_old_folder_tells_what_it_can(path, ask):
    (path / "run.json").write_text(json.dumps({"status": "finished"}))
    for name in ("surface.h5", "particles.vtkhdf"):
        (path / name).unlink(missing_ok=True)
    text = re.sub(r"(?m)^case = .*$", 'case = "of_another_version"', (path / "case.toml").read_text())
    (path / "case.toml").write_text(text)
    state = ask(path)[1]
    assert state["case"] == "of another version" and len(state["problems"]) == 1
    assert "unknown case" in state["problems"][0] and [len(panel["curves"]) for panel in state["panels"]] == [2, 1, 1]
    assert ask(path, "/results")[1]["rows"] == []


def test_a_flow_without_a_body_and_in_space(tmp_path, ask):
    case = TaylorGreen(resolution=8, dimensions=3)
    state = ask(case.run(tmp_path / "run", until=0.02, progress=False).path)[1]
    assert state["panels"][0]["title"].startswith("kinetic energy") and "vorticity" in state["fields"]
    answer, text = ask(tmp_path / "run", "/picture?field=vorticity&width=wide&ink=light")
    assert answer.status == 200 and text.startswith(b"\x89PNG")  # of the plane in the middle


def test_long_curves_keep_their_peaks():
    values = np.sin(np.linspace(0, 50, 10**6))
    values[[123_456, 654_321]] = 7.0, -3.0
    values[777_777] = np.nan
    thin = watched._thinned(values)
    assert len(thin) == 2 * watched.BUCKETS and max(thin) == 7.0 and min(thin) == -3.0
    time = watched._thinned(np.arange(10.0**6))
    assert time == sorted(time) and abs(time[thin.index(7.0)] - 123_456) < 10**6 / watched.BUCKETS


def test_conditional_requests_and_head(path, ask):
    answer, _ = ask(path)
    again, text = ask(path, If_None_Match=answer.headers["ETag"])
    assert (again.status, text) == (304, b"") and again.headers["ETag"] == answer.headers["ETag"]
    assert ask(path, If_None_Match='"other"')[0].status == 200
    head, text = ask(path, "/", method="HEAD")
    assert (head.status, text) == (200, b"") and int(head.headers["Content-Length"]) == len(server.page())


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PATCH"])
def test_nothing_but_get_and_head(path, ask, method):
    assert ask(path, method=method)[0].status == 501


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("localhost", 200),
        ("localhost:9000", 200),
        ("127.0.0.1:8000", 200),
        ("[::1]:8000", 200),
        ("evil.example", 403),
        ("evil.example:8000", 403),
        ("localhost.evil.example", 403),
        ("127.0.0.1.evil.example", 403),
        ("localhost@evil.example", 403),
        ("[localhost", 403),
        ("", 403),
    ],
)
def test_only_who_calls_this_machine_by_its_name_is_answered(path, ask, host, status):
    answer, text = ask(path, "/", host=host)
    assert answer.status == status and (b"<html" in text) == (status == 200)
    assert "Access-Control-Allow-Origin" not in answer.headers


@pytest.mark.parametrize(
    "target",
    [
        "/run.json",
        "/../run.json",
        "/figures/forces.png",
        "/figure",
        "/figure?name=",
        "/figure?name=../run.json",
        "/figure?name=..%2Frun.json",
        "/figure?name=%2Fetc%2Fpasswd",
        "/figure?name=link.png",
        "/figure?name=notes.txt",
        "/figure?name=a%00.png",
        "/picture",
        "/picture?field=kind&width=wide&ink=dark",
        "/picture?field=vorticity&width=1e9&ink=dark",
        "//[",
    ],
)
def test_no_file_but_the_figures_can_be_had(path, ask, target):
    (path / "figures").mkdir()
    (path / "figures" / "notes.txt").write_text("mine")
    (path / "figures" / "link.png").symlink_to("/etc/passwd")
    assert ask(path, target)[0].status == 404


def test_figures_are_shown_the_newest_first(path, ask, tmp_path):
    figures = path / "figures"
    figures.mkdir()
    for number, name in enumerate(("b & c.png", "film.gif", "a.png")):
        (figures / name).write_bytes(PNG + bytes([number]))
        os.utime(figures / name, (number, number))
    found = ask(path)[1]["figures"]
    assert [each["name"] for each in found] == ["a.png", "film.gif", "b & c.png"]
    answer, text = ask(path, "/figure?" + urlencode({"name": "b & c.png"}))
    assert (answer.status, text, answer.headers["Content-Type"]) == (200, PNG + b"\0", "image/png")
    assert ask(path, "/figure?name=film.gif")[0].headers["Content-Type"] == "image/gif"
    figures.rename(tmp_path / "elsewhere")
    figures.symlink_to(tmp_path / "elsewhere")
    assert wait_for(lambda: ask(path)[1]["figures"] == [])
    assert ask(path, "/figure?name=film.gif")[0].status == 404


def test_a_picture_is_drawn_once(path, ask, monkeypatch):
    drawn, draw = [], plotting.field
    monkeypatch.setattr(plotting, "field", lambda *each, **options: drawn.append(each[1]) or draw(*each, **options))
    target = "/picture?field={}&width={}&ink=light".format
    threads = [threading.Thread(target=ask, args=(path, target("vorticity", "wide"))) for _ in range(4)]
    ask(path, "/")
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert drawn == ["vorticity"]
    answer, text = ask(path, target("velocity", "narrow"))
    assert drawn == ["vorticity", "velocity"] and answer.status == 200 and text.startswith(PNG)
    time = RunFolder(path).read_checkpoint().state["time"]
    alsph.resume(path, until=time + 0.05, progress=False)
    ask(path, target("vorticity", "wide"))
    assert drawn == ["vorticity", "velocity", "vorticity"]


def test_a_port_that_is_taken(path, alsph):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        code, _, stderr = alsph("watch", path, "--port", port, "--no-browser")
        assert code == 2 and f"port {port}: cannot be had (Address already in use); give another one" in stderr
    for port in (-1, 65536):
        with pytest.raises(ConfigError, match="port must be 0-65535"):
            server.serve(path, port)
    with server.serve(path) as first, server.serve(path) as second:
        assert first.port in server.PORTS and second.port in server.PORTS and first.port != second.port


def test_ctrl_c_ends_it_quietly(path):
    process = command("watch", path, "--port", 0, "--no-browser", env=os.environ | {"SSH_CONNECTION": "a b c d"})
    first, second = process.stdout.readline(), process.stdout.readline()
    port = int(re.match(r"http://127\.0\.0\.1:(\d+)/ shows .*run; Ctrl-C ends", first)[1])
    assert f"ssh -L {port}:localhost:{port} " in second
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)  # and stays open
    connection.request("GET", "/state")
    assert connection.getresponse().status == 200
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60) == ("", "") and process.returncode == 0


def test_the_page_needs_nothing_from_elsewhere():
    page = server.page().decode()
    assert set(re.findall(r"https?://[^\s\"']*", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.findall(r"(?:src|href|fetch\(|action)\s*=?\s*[\"'`]/", page)
    assert "innerHTML" not in page and "sha256-" in server.policy(server.page())


BROWSERS = map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))
BROWSER = os.environ.get("ALSPH_BROWSER") or next(filter(None, BROWSERS), None)


@pytest.fixture
def shown(ask, tmp_path):
    """Return a function that opens the page of a folder in a browser and returns what stands on it."""
    if BROWSER is None:
        pytest.skip("no chromium or chrome on the PATH")

    def shown(folder, *options):
        with server.serve(folder, 0) as serving:
            threading.Thread(target=serving.serve_forever, args=[0.01], daemon=True).start()
            flags = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'browser'}"]
            budget = ["--virtual-time-budget=10000", "--dump-dom", *options]
            address = f"http://localhost:{serving.port}/"
            done = subprocess.run([BROWSER, *flags, *budget, address], capture_output=True, text=True, timeout=120)
            serving.shutdown()
        assert "<main>" in done.stdout, done.stderr
        return done.stdout.split("<script>")[0]

    return shown


def test_the_page_in_a_browser(path, shown):
    page = shown(path)
    assert ">finished</span>" in page and "Re = 200, D/Δx = 8" in page and "of 0.4" in page
    assert page.count("<svg") == 5 + 3 + 3 + 2 + 1 + 1 and page.count(' d="M') > 10
    assert 'src="picture?field=vorticity' in page and "velocity divergence" in page
    assert "mean drag coefficient" in page and "<li>coarse: " in page
    assert '<div id="trouble" role="alert"></div>' in page


def test_hostile_texts_are_texts(path, shown):
    evil = '<img src=x onerror="document.title=1"><script>document.body.remove()</script>'
    info = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps(info | {"case": evil, "message": evil, "status": evil}))
    (path / "figures").mkdir()
    (path / "figures" / "<b onclick=x>.png").write_bytes(PNG)
    page = shown(path)
    assert "&lt;img src=x onerror=" in page and page.count("<script") == 0 and "<img src=x" not in page
    assert "<b onclick" not in page.replace('alt="<b onclick', "") and "&lt;b onclick=x&gt;.png" in page
    assert page.count("<svg") > 5


def test_a_picture_that_cannot_be_drawn_is_told(path, shown):
    (path / "particles.vtkhdf").write_bytes(b"nothing")
    page = shown(path)
    assert "The newest snapshot cannot be drawn." in page and page.count(' d="M') > 10


def test_a_page_whose_folder_is_gone_says_so(path, shown):
    (path / "run.json").unlink()
    assert "run.json is missing" in shown(path)
