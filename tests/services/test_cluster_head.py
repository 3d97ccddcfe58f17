"""A cluster's head that is not there, is something else, or wants a token: one line each."""

import http.server
import socket
import ssl
import threading
from datetime import UTC, datetime, timedelta

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from web import served

from services.cluster import head as module
from services.cluster.head import Head
from services.cluster.jobs import Jobs
from services.cluster.token import Token
from services.errors import ClusterError, ClusterLostError, ClusterRefusedError, TrackingError
from services.tracking.server import look_at_server


class Page(http.server.BaseHTTPRequestHandler):
    """Some other web server: everything is a page."""

    status = 200

    def do_GET(self):
        self.send_response(self.status)
        self.send_header("Location", "http://127.0.0.2:1/")
        self.end_headers()
        self.wfile.write(b"<html>hello</html>")


class Missing(Page):
    status = 404


class Elsewhere(Page):
    status = 302


def test_a_port_that_nobody_listens_at(tmp_path):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    jobs = Jobs(Head(f"http://127.0.0.1:{port}"))
    with pytest.raises(ClusterLostError, match=rf":{port}: it cannot be reached \(.*refused"):
        jobs.ray_version()
    with pytest.raises(ClusterLostError, match="check that the cluster runs"):
        jobs.head.listen("/api/jobs/x/logs/tail", print)


def test_a_name_that_is_nobodys():
    with pytest.raises(ClusterLostError, match="cannot be reached"):
        Jobs(Head("http://nobody.invalid:8265")).ray_version()


@pytest.fixture
def self_signed(tmp_path):
    """A certificate that nobody vouches for, with its key."""
    key, subject = ec.generate_private_key(ec.SECP256R1()), x509.Name([])
    now = datetime.now(UTC)
    made = (
        x509.CertificateBuilder(subject, subject, key.public_key(), 1, now, now + timedelta(1))
        .sign(key, hashes.SHA256())
        .public_bytes(Encoding.PEM)
    )
    file = tmp_path / "server.pem"
    file.write_bytes(made + key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    return file


def test_a_certificate_that_is_not_trusted_and_a_port_without_tls(self_signed):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(self_signed)
    with served(Page, context) as url:
        with pytest.raises(ClusterLostError, match=r"not trusted: self-signed.*; .*SSL_CERT_FILE"):
            Jobs(Head(url.replace("http:", "https:"))).ray_version()
        with pytest.raises(TrackingError, match=r"not trusted: self-signed.*; .*SERVER_CERT_PATH"):
            look_at_server(url.replace("http:", "https:"))
    with served(Page) as url, pytest.raises(ClusterLostError, match=r"; write http://"):
        Jobs(Head(url.replace("http:", "https:"))).ray_version()


def test_a_port_that_never_answers(monkeypatch):
    monkeypatch.setattr(module, "ANSWER_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(ClusterLostError, match="no answer in time"):
            Jobs(Head(url)).list()


@pytest.mark.parametrize("handler", [Page, Missing, Elsewhere])
def test_another_web_server_is_no_dashboard(handler):
    with served(handler) as url, pytest.raises(ClusterError, match="is no Ray dashboard") as caught:
        Jobs(Head(url)).ray_version()
    assert "port 8265" in str(caught.value)


@pytest.mark.parametrize("handler", [Page, Missing])
def test_a_log_is_not_followed_at_another_web_server(handler):
    with served(handler) as url, pytest.raises(ClusterError, match="is no Ray dashboard"):
        Head(url).listen("/api/jobs/x/logs/tail", print)


def test_the_token_is_not_sent_on_by_a_redirection():
    heard = []

    class Thief(Page):
        def do_GET(self):
            heard.append(self.headers.get("Authorization"))
            super().do_GET()

    with served(Thief) as thief:

        class Honest(Thief):
            status = 302

            def send_header(self, name, value):
                super().send_header(name, thief if name == "Location" else value)

        with served(Honest) as url:
            head = Head(url, Token("secret", "a test"))
            with pytest.raises(ClusterError):
                Jobs(head).ray_version()
            with pytest.raises(ClusterError):
                head.listen("/api/jobs/x/logs/tail", print)
    assert heard == ["Bearer secret", "Bearer secret", None]


def test_something_that_does_not_speak_http():
    with socket.create_server(("127.0.0.1", 0)) as server:

        def greet():
            for _ in range(3):
                connection, _ = server.accept()
                connection.recv(1000)
                connection.sendall(b"SSH-2.0-OpenSSH_9.2\r\n")
                connection.close()

        threading.Thread(target=greet, daemon=True).start()
        url = f"http://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(ClusterError, match="no Ray dashboard"):
            Jobs(Head(url)).ray_version()


@pytest.mark.parametrize("url", ["127.0.0.1:8265", "ray://head:10001", "http://", "http://a:b"])
def test_an_address_that_is_none(url):
    with pytest.raises(ClusterError, match="HOST:"):
        Head(url)


def test_a_token_comes_from_its_file_then_from_the_variables(tmp_path):
    mine, theirs = tmp_path / "mine", tmp_path / "theirs"
    mine.write_text("secret-of-mine\n")
    theirs.write_text("secret-of-theirs")
    environment = {"RAY_AUTH_TOKEN": "in-words", "RAY_AUTH_TOKEN_PATH": str(theirs)}
    assert Token.find(mine, environment).value == "secret-of-mine"
    assert Token.find(None, environment).value == "in-words"
    del environment["RAY_AUTH_TOKEN"]
    found = Token.find(None, environment)
    assert found.value == "secret-of-theirs"
    assert "theirs (written 2" in found.source
    assert "secret" not in repr(found)
    assert Token.find(None, {}) is None


@pytest.mark.parametrize("content", [b"", b"two words", b"\xff\xfe", b"x" * 5000])
def test_a_file_that_holds_no_token(tmp_path, content):
    file = tmp_path / "token"
    file.write_bytes(content)
    with pytest.raises(ClusterRefusedError, match=r"copy (the token|it) from the cluster's head"):
        Token.find(file)


def test_a_token_file_that_is_not_there(tmp_path):
    with pytest.raises(ClusterRefusedError, match=r"none cannot be read \(No such file"):
        Token.find(tmp_path / "none")
