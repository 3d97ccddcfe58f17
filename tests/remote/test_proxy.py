"""docker/proxy/nginx.conf in front of a real Ray head and a real MLflow server."""

import base64
import json
import shutil
import ssl
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from tracking_server import mlflow_server
from web import free_ports

pytestmark = pytest.mark.slow

CONFIGURATION = Path(__file__).parents[2] / "docker" / "proxy" / "nginx.conf"
SEARCH = "/api/2.0/mlflow/experiments/search"
CREATE = "/api/2.0/mlflow/experiments/create"
NEEDED = ("nginx", "openssl", "htpasswd")


@dataclass(frozen=True)
class Proxy:
    """The two addresses that are open to others, and the certificate that they show."""

    ray: str
    mlflow: str
    certificate: Path

    def ask(self, url, body=None, **headers):
        """Status and text of an answer."""
        data = None if body is None else json.dumps(body).encode()
        typed = {name.replace("_", "-"): value for name, value in headers.items()}
        request = urllib.request.Request(url, data, {"Content-Type": "application/json", **typed})
        context = ssl.create_default_context(cafile=self.certificate)
        try:
            with urllib.request.urlopen(request, timeout=30.0, context=context) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()


def basic(name, password):
    return "Basic " + base64.b64encode(f"{name}:{password}".encode()).decode()


ADA = basic("ada", "lovelace")


@contextmanager
def nginx(folder, changes):
    """Nginx with the repository's configuration, other ports in the place of its own."""
    text = CONFIGURATION.read_text()
    for ours, theirs in changes.items():
        assert ours in text, ours
        text = text.replace(ours, str(theirs))
    (folder / "nginx.conf").write_text(text)
    only_here = f"daemon off; error_log {folder}/error.log;"
    command = ["nginx", "-c", folder / "nginx.conf", "-g", only_here]
    process = subprocess.Popen(command)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(timeout=20)


@pytest.fixture(scope="module")
def proxy(head, tmp_path_factory):
    missing = [name for name in NEEDED if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed")
    # Its workers are of another user, who must be let in.
    folder = Path(tempfile.mkdtemp(prefix="lmtr-proxy-", dir="/tmp"))
    folder.chmod(0o755)
    certificate, key = folder / "cluster.crt", folder / "cluster.key"
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1"]
    made += ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
    subprocess.run(
        [*made, "-keyout", key, "-out", certificate], check=True, stderr=subprocess.DEVNULL
    )
    key.chmod(0o600)
    subprocess.run(["htpasswd", "-B", "-b", "-c", folder / "users", "ada", "lovelace"], check=True)
    front_mlflow, front_ray = free_ports(2)
    with mlflow_server(tmp_path_factory.mktemp("mlflow")) as server:
        ports = {
            "pid lmtr-proxy.pid": f"pid {folder}/pid",
            "5443": front_mlflow,
            "8443": front_ray,
            "127.0.0.1:8265": head.url.removeprefix("http://"),
            "127.0.0.1:5000": server.removeprefix("http://"),
        }
        with nginx(folder, ports) as process:
            made = Proxy(
                f"https://localhost:{front_ray}", f"https://localhost:{front_mlflow}", certificate
            )
            until = time.monotonic() + 20.0
            while True:
                assert process.poll() is None, "nginx does not start"
                try:
                    made.ask(f"{made.mlflow}/health")
                    break
                except OSError:
                    assert time.monotonic() < until
                    time.sleep(0.1)
            yield made
    shutil.rmtree(folder)


@pytest.mark.parametrize("who", [None, basic("ada", "wrong"), basic("eve", "lovelace")])
def test_mlflow_wants_a_password(proxy, who):
    headers = {} if who is None else {"Authorization": who}
    for path in ("/", "/health", "/version", f"{SEARCH}?max_results=1"):
        assert proxy.ask(proxy.mlflow + path, **headers)[0] == 401
    assert proxy.ask(proxy.mlflow + CREATE, {"name": "theirs"}, **headers)[0] == 401
    told = proxy.ask(f"{proxy.mlflow}{SEARCH}?max_results=100", Authorization=ADA)
    assert told[0] == 200
    assert "theirs" not in told[1]


def test_its_own_pages_may_send_and_those_of_others_may_not(proxy):
    def create(name, **headers):
        return proxy.ask(proxy.mlflow + CREATE, {"name": name}, Authorization=ADA, **headers)[0]

    assert create("by a program") == 200
    assert create("by its page", Origin=proxy.mlflow) == 200
    assert create("by another", Origin="https://stranger.example") == 403
    assert create("by a likeness", Origin=f"{proxy.mlflow}.stranger.example") == 403
    assert create("by a file", Origin="null") == 403
    told = proxy.ask(f"{proxy.mlflow}{SEARCH}?max_results=100", Authorization=ADA)[1]
    assert {each["name"] for each in json.loads(told)["experiments"]} >= {
        "by a program",
        "by its page",
    }
    assert not any(f"by {who}" in told for who in ("another", "a likeness", "a file"))


def test_ray_wants_its_token_behind_it(proxy, head):
    token = head.token_file.read_text().strip()
    for headers in ({}, {"Authorization": "Bearer " + "0" * 64}):
        assert proxy.ask(f"{proxy.ray}/api/jobs/", **headers)[0] in (401, 403)
    assert proxy.ask(f"{proxy.ray}/api/jobs/", Authorization=f"Bearer {token}")[0] == 200


@pytest.fixture
def far(proxy, user, head, tmp_path):
    """The same user at another machine, who knows the proxy alone."""
    settings = tmp_path / "far.toml"
    settings.write_text(
        f'profile = "far"\n[profiles.far]\ncluster = "{proxy.ray}"\n'
        f'token_file = "{head.token_file}"\ntracking = "{proxy.mlflow}"\n'
    )
    environment = {
        **user.environment,
        "LMTR_SETTINGS": str(settings),
        "SSL_CERT_FILE": str(proxy.certificate),
        "REQUESTS_CA_BUNDLE": str(proxy.certificate),
        "MLFLOW_TRACKING_USERNAME": "ada",
        "MLFLOW_TRACKING_PASSWORD": "lovelace",
    }
    return type(user)(tmp_path, environment)


def test_a_client_works_through_it(far):
    job_id = far.submits("generate", "-c", "walks.toml", "--solutions", "1")
    followed = far.types("logs", job_id, "-f")
    assert followed.returncode == 0, followed.stderr
    assert "generate" in followed.stdout
    pages = far.types("ui")
    assert pages.returncode == 0, pages.stderr
    assert "MLflow" in pages.stderr
    done = far.types("doctor", "--cluster", "--json")
    found = {each["what"]: each for each in json.loads(done.stdout)["findings"]}
    assert found["MLflow from here"]["grade"] == "good", found
    assert found["strangers"]["grade"] == "good", found


def test_a_client_without_what_it_needs_is_told(far, proxy):
    def at(**changed):
        left = {**far.environment, **changed}
        kept = {name: value for name, value in left.items() if value is not None}
        return type(far)(far.folder, kept)

    done = at(MLFLOW_TRACKING_PASSWORD="wrong").types("ui")
    assert done.returncode == 2
    assert "MLFLOW_TRACKING_USERNAME" in done.stderr
    done = at(SSL_CERT_FILE=None).types("jobs")
    assert done.returncode == 2
    assert "SSL_CERT_FILE" in done.stderr
    done = far.types("jobs", "--cluster", proxy.ray.replace("https", "http"))
    assert done.returncode == 2
