"""Runs the service on a free loopback port and Schemathesis against it, with its OpenAPI document: without tokens, with one,
and without the one that is needed. `make schemathesis` installs what it needs and calls this.
"""

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
SCHEMATHESIS = os.path.join(os.path.dirname(sys.executable), "schemathesis")
TOKEN = "0123456789abcdef0123456789abcdef"

os.environ.setdefault("CAGER_READY", "")
os.environ.setdefault("CAGER_DONE", "")


def call(url, body=None, media_type=None, token=None, method=None):
    headers = {"Content-Type": media_type} if media_type else {}
    if token:
        headers["Authorization"] = f"Bearer {token}"
    request = urllib.request.Request(url, body, headers, method=method)
    with urllib.request.urlopen(request, timeout=30) as response:
        return response.read()


def new_session(url, token):
    sys.path.insert(0, HERE)
    from hooks import model

    parts = ""
    for name, scale in [("rest", 0.5), ("cage", 1.0)]:
        head = f'--B\r\nContent-Disposition: form-data; name="{name}"; filename="{name}.obj"\r\n\r\n'
        parts += head + model(scale).decode() + "\r\n"
    session = json.loads(call(f"{url}/v1/sessions", (parts + "--B--\r\n").encode(), "multipart/form-data; boundary=B", token))
    for _ in range(300):
        session = json.loads(call(f"{url}/v1/sessions/{session['id']}", token=token))
        if session["state"] == "ready":
            assert session["points"] == session["unknowns"] == session["handle_count"] == 8, session
            return session["id"]
        time.sleep(0.1)
    sys.exit(f"the session does not get ready: {session}")


def seed(url, token):
    """One session that is ready, one that is completed."""
    ready, done = new_session(url, token), new_session(url, token)
    from hooks import rows

    call(f"{url}/v1/sessions/{done}/frames", rows([0.1 * k for k in range(24)]) * 3, "application/octet-stream", token)
    call(f"{url}/v1/sessions/{done}/complete", b'{"frames": 3}', "application/json", token)
    return {"CAGER_READY": ready, "CAGER_DONE": done}


def run(cager, name, guarded, token, arguments):
    """One run against a service of its own; whether all went well."""
    with tempfile.TemporaryDirectory(prefix="cager-schemathesis-") as folder:
        command = [cager, "serve", "--listen", "127.0.0.1:0", "--data", os.path.join(folder, "data")]
        command += ["--set", "tenant_max_sessions=100000", "--log-filter", "warn"]
        if guarded:
            tokens = os.path.join(folder, "tokens.toml")
            with open(tokens, "w") as file:
                digest = hashlib.sha256(TOKEN.encode()).hexdigest()
                file.write(f'[[token]]\nname = "a"\ntenant = "t"\nsha256 = "{digest}"\n')
            command += ["--tokens", tokens]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            line = server.stdout.readline()
            if not line.startswith("listening on "):
                sys.exit(f"the service does not start: {line}")
            url = "http://" + line.split()[-1]
            environment = os.environ | {"SCHEMATHESIS_HOOKS": os.path.join(HERE, "hooks.py")}
            environment |= seed(url, TOKEN if guarded else None)
            document = json.loads(call(f"{url}/openapi.json"))
            if not guarded:
                # Nobody is asked for a token, and the document says that some services do.
                del document["security"], document["components"]["securitySchemes"]
            path = os.path.join(folder, "openapi.json")
            with open(path, "w") as file:
                json.dump(document, file)
            config = os.path.join(HERE, "schemathesis.toml")
            command = [SCHEMATHESIS, "--config-file", config, "run", path, "--url", url, "--seed", "1", "--request-timeout", "20", *arguments]
            if token:
                command += ["--header", f"Authorization: Bearer {token}"]
            print(f"== {name}", flush=True)
            done = subprocess.run(command, env=environment, cwd=folder, timeout=3600)
            alive = server.poll() is None
            healthy = alive and json.loads(call(f"{url}/healthz"))["status"] == "ok"
        finally:
            server.send_signal(signal.SIGTERM)
            try:
                server.wait(40)
            except subprocess.TimeoutExpired:
                server.kill()
                server.wait()
        print(f"== {name}: schemathesis {done.returncode}, service {'well' if healthy else 'NOT WELL'}, its exit {server.returncode}", flush=True)
        return done.returncode == 0 and healthy and server.returncode == 0


def main():
    cager = os.path.abspath(sys.argv[1])
    more = sys.argv[2:]
    runs = [
        ("open service", False, None, ["--mode", "all", *more]),
        # The token is sent where its absence is the case; whether it is asked for, ignored_auth and the next run say.
        ("guarded service with a token", True, TOKEN, ["--mode", "all", "--exclude-checks", "missing_required_header", *more]),
        # Everything is 401 here, whatever the data.
        ("guarded service without a token", True, None,
         ["--mode", "positive", "--phases", "coverage,fuzzing", "--exclude-checks", "positive_data_acceptance,missing_required_header", *more]),
    ]
    failed = [name for name, *rest in runs if not run(cager, name, *rest)]
    if failed:
        sys.exit("failed: " + ", ".join(failed))


if __name__ == "__main__":
    main()
