"""Encrypted connections, with real certificates and a real server on loopback."""

import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import grpc
import pytest
from nidaqmx._stubs import nidaqmx_pb2_grpc

from sautereau.daq.errors import DaqError
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.acquisition import Tls
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig
from sautereau.sim_backend.devices.daqmx.server import Servicer
from tests.cards import Card

NEW_KEY = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout"


def openssl(*arguments):
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)


def authority(folder):
    """Make an authority, and return the paths of its certificate and key."""
    folder.mkdir()
    key, certificate = folder / "root.key", folder / "root.pem"
    openssl(*f"req -x509 -days 1 -subj /CN=authority {NEW_KEY} {key} -out {certificate}".split())
    return certificate, key


def signed(folder, name, root):
    """Make a certificate for localhost, and return its path and that of its key."""
    key, request, certificate = (folder / f"{name}.{end}" for end in ("key", "csr", "pem"))
    extensions = folder / f"{name}.txt"
    extensions.write_text("subjectAltName=DNS:localhost,IP:127.0.0.1\n")
    openssl(*f"req -subj /CN={name} {NEW_KEY} {key} -out {request}".split())
    signing = f"-CA {root[0]} -CAkey {root[1]} -CAcreateserial -extfile {extensions}"
    openssl(*f"x509 -req -days 1 -in {request} {signing} -out {certificate}".split())
    return certificate, key


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    folder = tmp_path_factory.mktemp("certificates")
    root = authority(folder / "ours")
    return {
        "root": root,
        "server": signed(folder, "server", root),
        "client": signed(folder, "client", root),
        "other": authority(folder / "other"),
    }


@pytest.fixture
def served(certificates, paper):
    """Serve a card over TLS; return the daq of a rig for it."""
    servers = []

    def start(asks_client=False):
        certificate, key = certificates["server"]
        credentials = grpc.ssl_server_credentials(
            [(key.read_bytes(), certificate.read_bytes())],
            certificates["root"][0].read_bytes(),
            asks_client,
        )
        server = grpc.server(ThreadPoolExecutor(2))
        nidaqmx_pb2_grpc.add_NiDAQmxServicer_to_server(Servicer(Card()), server)
        port = server.add_secure_port("127.0.0.1:0", credentials)
        server.start()
        servers.append(server)
        return paper.daq.model_copy(update={"address": f"localhost:{port}"})

    yield start
    for server in servers:
        server.stop(grace=0).wait()


def trust(daq, certificate, client=None):
    tls = Tls(
        root_certificate=str(certificate),
        client_certificate=str(client[0]) if client else "",
        client_key=str(client[1]) if client else "",
    )
    return daq.model_copy(update={"tls": tls})


def count(daq):
    with Acquisition(daq, 0.05) as acquisition:
        acquisition.start()
        return sum(block.volts.shape[1] for block in acquisition.blocks())


def test_samples_come_encrypted(served, certificates):
    assert count(trust(served(), certificates["root"][0])) == 2560


def test_both_sides_show_a_certificate(served, certificates):
    daq = served(asks_client=True)
    assert count(trust(daq, certificates["root"][0], certificates["client"])) == 2560
    with pytest.raises(DaqError, match=r"accepts daq\.tls\.client_certificate"):
        count(trust(daq, certificates["root"][0]))


def test_a_server_of_another_authority_is_refused(served, certificates):
    with pytest.raises(DaqError, match=r"daq\.tls\.root_certificate signed its certificate"):
        count(trust(served(), certificates["other"][0]))


def test_a_server_with_tls_is_not_reached_without(served):
    with pytest.raises(DaqError, match=r"or daq\.tls if it uses TLS"):
        count(served())


def test_a_server_without_tls_is_not_reached_with(bench, certificates):
    _, server, rig = bench()
    daq = rig.daq.model_copy(update={"address": server.address})
    with pytest.raises(DaqError, match="runs with TLS"):
        count(trust(daq, certificates["root"][0]))


def test_missing_certificates_are_reported_together(paper, tmp_path):
    gone = tmp_path / "gone.pem"
    daq = paper.daq.model_copy(update={"address": "daq.example.org:31763"})
    with pytest.raises(DaqError) as caught:
        count(trust(daq, gone, (gone, gone)))
    for name in ("root_certificate", "client_certificate", "client_key"):
        assert f"daq.tls.{name} {gone}: No such file" in str(caught.value)


def test_another_machine_without_tls_only_when_the_rig_says_so(paper):
    daq = paper.daq.model_copy(update={"address": "192.0.2.1:31763", "insecure": True})
    with pytest.raises(DaqError, match="no server answered"):
        count(daq)


def test_a_key_without_its_certificate_is_refused():
    with pytest.raises(ValueError, match="only client_key is given"):
        Tls(root_certificate="root.pem", client_key="client.key")


def test_a_rig_file_gives_tls_and_not_insecure_as_well(tmp_path):
    text = (Path(__file__).parents[2] / "rig" / "paper.toml").read_text(encoding="utf-8")
    text = text.replace('address = ""', 'address = "bench.example:31763"')
    path = tmp_path / "rig.toml"
    given = '[daq]\ntls = { root_certificate = "~/ca.pem" }\n'
    path.write_text(text.replace("[daq]\n", given), encoding="utf-8")
    assert load_rig(path).daq.tls == Tls(root_certificate="~/ca.pem")
    path.write_text(text.replace("[daq]\n", given + "insecure = true\n"), encoding="utf-8")
    with pytest.raises(RigError, match="tls, insecure: both are given"):
        load_rig(path)
