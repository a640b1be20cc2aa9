"""The service's figures: `cager serve` on loopback, driven by `cager encode --server` and by plain sockets.

Standard library only. `run.py` imports it.
"""

import http.client
import json
import os
import socket
import statistics
import struct
import subprocess
import tempfile
import time


class Service:
    """A service on a free port with a data folder of its own."""

    def __init__(self, program):
        self.data = tempfile.TemporaryDirectory()
        command = [program, "serve", "--listen", "127.0.0.1:0", "--data", self.data.name, "--log-filter", "warn"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().split()[-1]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(30)
        self.process.stdout.close()
        self.data.cleanup()


def form(folder, name):
    """A multipart body that makes a session."""
    boundary = "cager-bench"
    body = b""
    for part in ("rest", "cage"):
        head = f'--{boundary}\r\nContent-Disposition: form-data; name="{part}"; filename="{part}.obj"\r\n\r\n'
        with open(os.path.join(folder, f"{part}.obj"), "rb") as file:
            body += head.encode() + file.read() + b"\r\n"
    head = f'--{boundary}\r\nContent-Disposition: form-data; name="options"\r\n\r\n'
    body += (head + json.dumps({"name": name}) + f"\r\n--{boundary}--\r\n").encode()
    return body, {"Content-Type": f"multipart/form-data; boundary={boundary}"}


def ask(connection, method, path, body=None, headers=None):
    connection.request(method, path, body, headers or {})
    answer = connection.getresponse()
    data = answer.read()
    if answer.status >= 300:
        raise SystemExit(f"{method} {path}: {answer.status} {data[:300]}")
    return data


def ready_session(connection, folder, name):
    session = json.loads(ask(connection, "POST", "/v1/sessions", *form(folder, name)))
    while session["state"] == "preparing":
        time.sleep(0.005)
        session = json.loads(ask(connection, "GET", f"/v1/sessions/{session['id']}"))
    return session


def first_cage(address, session, frame, number):
    """Seconds from the last byte of a frame to its record, cage included, on an idle service."""
    host, port = address.split(":")
    accept = "Accept: application/vnd.cager.frames\r\nContent-Type: application/octet-stream\r\n"
    head = f"POST /v1/sessions/{session['id']}/frames?first={number} HTTP/1.1\r\nHost: {address}\r\n{accept}"
    head += f"Content-Length: {len(frame)}\r\n\r\n"
    wanted = 28 + 12 * session["unknowns"]
    with socket.create_connection((host, int(port))) as stream:
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        stream.sendall(head.encode() + frame)
        begin = time.perf_counter()
        data = b""
        while b"\r\n\r\n" not in data or len(data.split(b"\r\n\r\n", 1)[1]) < wanted:
            piece = stream.recv(65536)
            if not piece:
                raise SystemExit(f"the service closed the connection: {data[:300]}")
            data += piece
        return time.perf_counter() - begin


def spread(values):
    return {"best": min(values), "median": statistics.median(values)}


def measure(program, folder, encode, wall, runs):
    """Seconds of every figure. `encode` is the in-process command; `wall` times one."""
    with open(os.path.join(folder, "frames.npy"), "rb") as file:
        head = file.read(10)
        text = file.read(struct.unpack("<H", head[8:10])[0]).decode()
        points = int(text[text.index("(") + 1 :].split(",")[1])
        frames = [file.read(12 * points) for _ in range(30)]
    with Service(program) as service:
        connection = http.client.HTTPConnection(service.address)
        session = ready_session(connection, folder, "first")
        again = []
        for k in range(20):
            body, headers = form(folder, f"again {k}")
            begin = time.perf_counter()
            state = json.loads(ask(connection, "POST", "/v1/sessions", body, headers))["state"]
            again.append(time.perf_counter() - begin)
            if state != "ready":
                raise SystemExit("a session whose solver is there was not ready at once")
        cages = [first_cage(service.address, session, frame, k) for k, frame in enumerate(frames)]
        prepared = wall([*encode, "--server", f"http://{service.address}"])
    fresh, local = [], []
    # A service that has prepared nothing, in turns with the program alone.
    for _ in range(runs):
        with Service(program) as service:
            fresh.append(timed([*encode, "--server", f"http://{service.address}"]))
        local.append(timed(encode))
    return {
        "encode_fresh": spread(fresh),
        "encode_prepared": prepared,
        "encode_local": spread(local),
        "first_cage": spread(cages[5:]),
        "second_session": spread(again[2:]),
    }


def timed(command):
    begin = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begin
