# SPDX-License-Identifier: MIT
# The API as others see it: JSON-RPC 2.0 by its specification, over a Unix socket and over HTTP, and what must not get through.
import json
import re
import signal
import socket
import subprocess
import threading
import time

import pytest
from prometheus_client.parser import text_string_to_metric_families

from stage_daemon import BIN, ROOT, Client, Refused, until

OPERATING = ROOT / "docs/operating.md"
STATES = ("idle", "armed", "recording", "processing", "fault")


def rpc(daemon, text, **options):
    status, body = daemon.curl("/rpc", "--data-binary", text, **options)
    return status, json.loads(body) if body and status == 200 else body


def test_requests_are_answered_as_the_specification_says(daemon):
    answers = {
        '{"jsonrpc": "2.0", "method": "version", "id": "a"}': ("a", None),
        '{"jsonrpc": "2.0", "method": "no_such", "id": 1}': (1, -32601),
        '{"jsonrpc": "2.0", "method": "arm", "params": {"secs": 1}, "id": 2}': (2, -32602),
        '{"jsonrpc": "2.0", "method": "arm", "params": {"seconds": "long"}, "id": 2}': (2, -32602),
        '{"jsonrpc": "2.0", "method": "arm", "params": {"seconds": -1}, "id": 2}': (2, -32602),
        '{"jsonrpc": "2.0", "method": "record", "params": {"number": 0}, "id": 2}': (2, -32602),
        '{"jsonrpc": "2.0", "method": "calibrate", "params": {"cycles": 0}, "id": 2}': (2, -32602),
        '{"jsonrpc": "2.0", "method": 1, "id": 3}': (3, -32600),
        '{"jsonrpc": "1.0", "method": "version", "id": 4}': (4, -32600),
        '{"jsonrpc": "2.0", "method": "version", "params": [1], "id": 5}': (5, -32600),
        '{"jsonrpc": "2.0", "method": "version", "id": {}}': (None, -32600),
        '{"jsonrpc": "2.0", "method": "version"': (None, -32700),
        '{"method": "version", "method": "stop", "id": 1, "jsonrpc": "2.0"}': (None, -32700),
        "[]": (None, -32600),
        "[1]": (None, -32600),
        "17": (None, -32600),
        "[" * 5000: (None, -32700),
    }
    with daemon.connect() as client:
        for text, (number, code) in answers.items():
            client.send_line(text)
            over_socket = client.read()
            _, over_http = rpc(daemon, text)
            for answer in (over_socket, over_http):
                answer = answer[0] if isinstance(answer, list) else answer
                assert answer["jsonrpc"] == "2.0" and answer["id"] == number, (text, answer)
                assert answer.get("error", {}).get("code") == code, (text, answer)
    notification = '{"jsonrpc": "2.0", "method": "version"}'
    assert rpc(daemon, notification) == (204, "")
    batch = f'[{notification}, {{"jsonrpc": "2.0", "method": "version", "id": 7}}]'
    assert [one["id"] for one in rpc(daemon, batch)[1]] == [7]
    assert rpc(daemon, "[" + ",".join([notification] * 17) + "]")[1]["error"]["code"] == -32600


def iter_lines(lines):
    """Until nothing comes for a while."""
    while True:
        try:
            line = lines.readline()
        except OSError:
            return
        if not line:
            return
        yield line


# Each verb against a daemon that only notes what it is asked: nothing is there for a page that the command line lacks.
def test_every_method_is_called_by_the_command_that_it_names(daemon, tmp_path):
    methods = {one["name"]: one["command"] for one in daemon.call("version")["methods"]}
    called = set()
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(tmp_path / "noted.sock"))
    listener.listen()

    def serve():
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            connection.settimeout(1)  # then it is closed, as of a daemon that has gone: who follows events ends
            with connection, connection.makefile("r") as lines:
                for line in iter_lines(lines):
                    request = json.loads(line)
                    called.add(request["method"])
                    refusal = {"jsonrpc": "2.0", "id": request["id"], "error": {"code": -32000, "message": "noted"}}
                    if request["method"] in ("version", "subscribe", "clear_fault"):
                        refusal = {"jsonrpc": "2.0", "id": request["id"], "result": {"program": "", "api": ""}}
                    try:
                        connection.sendall((json.dumps(refusal) + "\n").encode())
                    except OSError:
                        break

    threading.Thread(target=serve, daemon=True).start()
    arguments = {"swap": ["s159"], "preview": ["-o", str(tmp_path / "x.png")]}
    for method, command in methods.items():
        before = set(called)
        words = command.split()[1:]
        environment = {"PATH": "/usr/bin", "STAGECTL_SOCKET": str(tmp_path / "noted.sock")}
        done = subprocess.run(
            [str(BIN / "stagectl"), *words, *arguments.get(method, [])], env=environment, capture_output=True, timeout=20
        )
        assert method in called, (method, command, called - before, done.stderr)
    listener.close()
    assert called == set(methods)


def test_the_page_of_operating_has_the_tables_of_the_program(daemon):
    page = OPERATING.read_text()
    version = daemon.call("version")
    rows = [[cell.strip(" `") for cell in line.split("|")[1:-1]] for line in page.splitlines() if line.startswith("| `")]
    table = {
        row[0]: (row[1], [state for state, cell in zip(STATES, row[2:]) if cell == "x"]) for row in rows if len(row) == 7
    }
    assert table == {one["name"]: (one["command"], one["allowed"]) for one in version["methods"]}
    events = re.findall(r"^\| (\d{3}) \| `(\w+)` \| (\w+) \| (.+) \|$", page, re.M)
    assert events == [(str(one["code"]), one["event"], one["level"], one["meaning"]) for one in version["events"]]


@pytest.mark.parametrize("state", ["idle", "armed"])
def test_a_method_that_the_state_does_not_allow_is_refused_by_name(daemon, state):
    if state == "armed":
        daemon.run("arm")
    for method in daemon.call("version")["methods"]:
        if state in method["allowed"] or method["name"] == "subscribe":
            continue
        with pytest.raises(Refused, match=f"the stage is in state {state}") as refused:
            daemon.call(method["name"])
        assert refused.value.code == -32001
    assert daemon.state() == state


def test_a_late_subscriber_gets_the_present_state_and_then_every_event_by_number(daemon):
    with daemon.connect() as first, daemon.connect() as late:
        first.call("subscribe")
        daemon.run("arm")
        state = late.call("subscribe")
        assert state["state"] == "armed" and state["plan"]["basis"] == "single"
        daemon.run("record", "--seconds", "0.1", "--no-wait")
        seen = []
        for client in (first, late):
            events = [client.next_event()]
            while events[-1]["event"] != "take_finished":
                events.append(client.next_event())
            numbers = [event["number"] for event in events]
            assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), "without gaps"
            seen.append({event["number"]: event for event in events})
        assert min(seen[1]) == state["event_number"] + 1
        assert all(seen[0][number] == event for number, event in seen[1].items())
        assert {"armed", "take_began", "dark"} <= {event["event"] for event in seen[0].values()}


def test_a_browser_can_follow_by_a_server_sent_stream(daemon):
    command = ["curl", "-sN", "-m", "10", "-H", f"Authorization: Bearer {daemon.token}"]
    stream = subprocess.Popen([*command, f"http://127.0.0.1:{daemon.port}/events"], stdout=subprocess.PIPE, text=True)
    lines = iter(stream.stdout.readline, "")
    assert next(line for line in lines if line.startswith("event:")) == "event: state\n"
    daemon.run("arm")
    data = next(line for line in lines if line.startswith("data:") and '"event":"armed"' in line)
    assert json.loads(data[5:])["data"]["basis"] == "single"
    stream.kill()
    stream.wait()


def test_http_asks_for_the_token_the_host_and_no_other_origin(daemon):
    call = '{"jsonrpc": "2.0", "method": "version", "id": 1}'
    wrong = daemon.token[:-1] + ("0" if daemon.token[-1] != "0" else "1")
    for token in (wrong, daemon.token[:-1], daemon.token + "0", " ", daemon.token.upper() + "é"):
        assert rpc(daemon, call, token=token)[0] == 401, token
    assert rpc(daemon, call)[0] == 200
    for path in ("/events", "/metrics", "/", "/../etc/passwd"):
        assert daemon.curl(path, token=wrong)[0] == 401
    assert daemon.curl("/rpc", "-d", call, "-H", "Host: evil.example")[0] == 421
    assert daemon.curl("/rpc", "-d", call, "-H", "Origin: http://evil.example")[0] == 403
    assert daemon.curl("/../etc/passwd")[0] == 404
    assert (daemon.socket.parent / "token").stat().st_mode & 0o777 == 0o640
    assert daemon.socket.stat().st_mode & 0o777 == 0o660


def test_it_listens_on_the_loopback_alone(daemon):
    table = subprocess.run(["ss", "-ltnH"], capture_output=True, text=True, check=True).stdout
    mine = [line.split()[3] for line in table.splitlines() if line.split()[3].endswith(f":{daemon.port}")]
    assert mine == [f"127.0.0.1:{daemon.port}"]


# A gigabyte by every way in: refused at once, and none of it kept.
def test_a_request_of_a_gigabyte_is_refused_and_takes_no_memory(daemon, tmp_path):
    huge = tmp_path / "huge"
    with huge.open("wb") as file:
        file.truncate(1_000_000_000)
    before = daemon.figures()[0]
    assert daemon.curl("/rpc", "--data-binary", f"@{huge}")[0] == 413
    assert daemon.curl("/rpc", "-H", "Transfer-Encoding: chunked", "-T", str(huge), "-X", "POST")[0] == 411
    assert daemon.curl("/rpc", "--data-binary", f"@{huge}", token="x" * 64)[0] in (401, 413)
    for target in (f"TCP:127.0.0.1:{daemon.port}", f"UNIX-CONNECT:{daemon.socket}"):
        subprocess.run(["socat", "-u", f"OPEN:{huge}", target], capture_output=True, timeout=60)
    with pytest.raises(BrokenPipeError), daemon.connect() as client:
        for _ in range(1000):
            client.socket.sendall(b"x" * 65536)
    high_water = int(re.search(r"VmHWM:\s+(\d+)", open(f"/proc/{daemon.process.pid}/status").read())[1]) << 10
    assert high_water < before + (64 << 20), (before, high_water)
    assert daemon.state() == "idle"


def test_a_line_without_an_end_and_a_slow_request_do_not_hold_it(daemon):
    slow = [socket.create_connection(("127.0.0.1", daemon.port)) for _ in range(30)]
    for one in slow:
        one.sendall(b"POST /rpc HTTP/1.1\r\nHost: 127.0.0.1\r\nX-")
    assert daemon.state() == "idle"  # over the Unix socket
    # Their time is over after ten seconds, however they trickle, and others have their turn.
    deadline = time.monotonic() + 120
    while daemon.curl("/metrics", "-m", "2")[0] != 200:
        for one in slow:
            try:
                one.sendall(b"a")
            except OSError:
                pass
        assert time.monotonic() < deadline
    for one in slow:
        one.close()


def test_a_subscriber_that_reads_nothing_is_let_go_of_and_others_notice_nothing(daemon):
    mute = socket.socket(socket.AF_UNIX)
    mute.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    mute.connect(str(daemon.socket))
    mute.sendall(b'{"jsonrpc": "2.0", "id": 1, "method": "subscribe"}\n')
    mute.sendall(b'{"jsonrpc": "2.0", "id": 2, "method": "version"}\n' * 90)
    with daemon.connect() as reader:
        reader.call("subscribe")
        for _ in range(3):
            daemon.run("arm"), daemon.run("stop")
        armed = [reader.until_event("armed") for _ in range(3)]
        assert len(armed) == 3
    until(lambda: daemon.events("client_dropped"))
    mute.close()


def test_a_full_house_hears_who_comes_to_put_the_light_out(daemon):
    daemon.run("record", "--seconds", "60", "--no-wait")
    silent = [socket.socket(socket.AF_UNIX) for _ in range(40)]
    for one in silent:
        one.connect(str(daemon.socket))
    assert daemon.run("stop", "--json")["dark"]
    assert "was silent" in daemon.events("client_dropped")[-1]["text"]
    for one in silent:
        one.close()


def test_a_daemon_that_hangs_is_said_with_what_ends_the_light_without_it(alone):
    daemon = alone()
    daemon.process.send_signal(signal.SIGSTOP)
    assert "use the emergency stop" in daemon.run("stop", code=1)
    daemon.process.send_signal(signal.SIGCONT)
    assert daemon.state() == "idle"


def test_two_clients_at_once_are_both_answered(daemon):
    with daemon.connect() as a, daemon.connect() as b:
        results = {}

        def work(name, client):
            results[name] = [client.call("status")["state"] for _ in range(60)]

        threads = [threading.Thread(target=work, args=pair) for pair in (("a", a), ("b", b))]
        [thread.start() for thread in threads], [thread.join() for thread in threads]
        assert len(results["a"]) == len(results["b"]) == 60
    both = [daemon.background("record", "--seconds", "0.1", "--json") for _ in range(2)]
    ends = [(process.communicate(timeout=120), process.returncode) for process in both]
    assert sorted(code for _, code in ends) == [0, 1], ends
    assert any("busy" in out[1] or "state" in out[1] for out, _ in ends), ends


@pytest.mark.parametrize("name", ["../x", "a/b", "..", "", " ", ".hidden", "x" * 65, "a\nb", "naïve", "a\0b", "-/../../etc"])
def test_names_stay_names(daemon, name):
    for method, params in (("record", {"slate": name}), ("preview", {"take": name}), ("swap", {"sequence": name})):
        if (method, name) in (("record", ""), ("preview", "")):
            continue  # left out: as configured
        with pytest.raises(Refused):
            daemon.call(method, **params)
    assert not daemon.takes.exists() or all(path.parent == daemon.takes for path in daemon.takes.iterdir())


def test_metrics_are_what_prometheus_reads(daemon):
    daemon.run("record", "--seconds", "0.1")
    status, page = daemon.curl("/metrics")
    assert status == 200
    families = {family.name: family for family in text_string_to_metric_families(page)}
    samples = {(s.name, tuple(s.labels.items())): s.value for f in families.values() for s in f.samples}
    assert samples[("stagectl_state", (("state", "idle"),))] == 1
    assert sum(value for (name, _), value in samples.items() if name == "stagectl_state") == 1
    assert samples[("stagectl_targets_written_total", ())] >= 1
    assert samples[("stagectl_events_total", (("event", "disk_failed"),))] == 0, "from the start: a rate needs it"
    assert samples[("stagectl_camera_slots_missing_total", (("camera", "0"), ("cause", "camera_gone")))] == 0
    assert samples[("stagectl_camera_frames_received_total", (("camera", "0"),))] >= 160
    for family in families.values():
        assert family.documentation and family.type in ("counter", "gauge")
        assert (family.type == "counter") == all(s.name.endswith("_total") for s in family.samples)


def test_calls_beyond_the_rate_wait_and_none_is_lost(daemon):
    with daemon.connect() as client:
        began = time.monotonic()
        for number in range(150):
            client.send_line(json.dumps({"jsonrpc": "2.0", "id": number, "method": "none"}))
        assert [client.read()["id"] for _ in range(150)] == list(range(150))
        assert time.monotonic() - began > 0.5


def test_a_second_daemon_at_the_same_place_is_refused(daemon):
    second = subprocess.run(
        [str(BIN / "stagectl"), "serve", "--config", str(daemon.config)], capture_output=True, text=True, timeout=30
    )
    assert second.returncode == 1 and "another program listens" in second.stderr
    assert daemon.state() == "idle"


def test_no_daemon_is_said_with_what_to_do(tmp_path):
    done = subprocess.run(
        [str(BIN / "stagectl"), "stop", "--socket", str(tmp_path / "none.sock")], capture_output=True, text=True
    )
    assert done.returncode == 1 and "stagectl serve" in done.stderr


def test_clients_may_be_of_any_kind(daemon):
    request = '{"jsonrpc":"2.0","id":1,"method":"status"}\n'
    done = subprocess.run(
        ["socat", "-t", "5", "-", f"UNIX-CONNECT:{daemon.socket}"], input=request, capture_output=True, text=True, timeout=20
    )
    assert json.loads(done.stdout)["result"]["state"] == "idle"
    assert isinstance(Client(daemon.socket), Client)
