"""What a server takes: Dockerfile, compose.yaml, the configuration of the proxy and the units of systemd.

Each is read by its own tool where there is one, and held to the rules of the lab; `tests/whole/test_behind_caddy.py`
runs the proxy.
"""

from __future__ import annotations

import configparser
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from app.commands.program import program
from app.config import LabConfig
from app.limits import Limits
from app.web.server import LET_PASS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
SERVER = ROOT / "docs" / "server"
DOCKERFILE = (ROOT / "Dockerfile").read_text(encoding="utf-8")
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))
LAB, PROXY = COMPOSE["services"]["lab"], COMPOSE["services"]["proxy"]
UNITS = sorted(path.name for path in SERVER.glob("shared-autonomy-lab*"))
ALIVE = "/api/health/live"
PROGRAM = "/opt/shared-autonomy-lab/.venv/bin/salab"


def tool(name: str) -> str:
    """A program that the tests bring, beside their Python."""
    path = Path(sys.executable).with_name(name)
    assert path.exists(), f"{name} is not installed: make test installs it"
    return str(path)


def done(command: Sequence[str], **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment or None)


def instructions(name: str) -> list[str]:
    """The Dockerfile's lines that begin with a word, continued lines joined."""
    joined = re.sub(r"\\\n\s*", "", DOCKERFILE)
    return [line.partition(" ")[2].strip() for line in joined.splitlines() if line.startswith(name + " ")]


def serves(arguments: Sequence[str]) -> dict[str, Any]:
    """What `salab serve` understands of these arguments; fails for one that it does not know."""
    assert arguments[0] == "serve"
    return dict(program().commands["serve"].make_context("serve", [*arguments[1:]]).params)


def never_listens_elsewhere(arguments: Sequence[str]) -> bool:
    understood = serves(arguments)
    return (understood["host"], understood["port"]) == (LabConfig().host, LabConfig().port)


# ---- the image


def test_the_linter_has_nothing_to_say_of_the_dockerfile() -> None:
    read = done([tool("hadolint"), "--no-color", str(ROOT / "Dockerfile")])
    assert (read.returncode, read.stdout) == (0, "")


def test_the_image_runs_as_nobody_in_particular_and_keeps_its_data_in_a_volume() -> None:
    assert instructions("USER") == ["10001"]
    assert instructions("VOLUME") == ["/data"]
    (entry,), (command,) = instructions("ENTRYPOINT"), instructions("CMD")
    assert yaml.safe_load(entry) == ["salab"]
    given = yaml.safe_load(command)
    assert str(serves(given)["data"]).startswith("/data/") and never_listens_elsewhere(given)
    assert all("-slim" in line for line in instructions("FROM"))


def test_the_image_is_asked_whether_the_process_answers_and_no_more() -> None:
    (check,) = instructions("HEALTHCHECK")
    asked = yaml.safe_load(check.partition("CMD ")[2])
    assert asked[:2] == ["python", "-c"] and ALIVE in asked[2] and f"'127.0.0.1', {LabConfig().port}" in asked[2]
    compile(asked[2], "HEALTHCHECK", "exec")
    gone = done([sys.executable, "-c", asked[2].replace(str(LabConfig().port), "9")])
    assert gone.returncode != 0, "nobody answers there"


def test_what_the_image_is_made_of_is_in_the_tree_and_holds_nobodys_data() -> None:
    lines = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    kept = {line[1:] for line in lines if line.startswith("!")}
    assert "*" in lines and lines.index("*") < min(lines.index(f"!{name}") for name in kept)
    assert kept >= {"app", "sim", "study", "static", "pyproject.toml", "LICENSE"}
    assert not kept & {"data", ".venv", ".git", ".env", "tests", "docs"}
    assert not [name for name in kept if not (ROOT / name).exists()]


def test_what_the_package_asks_for_is_there_when_the_image_is_built() -> None:
    """A file of licences that is not there is left out of a wheel without a word."""
    lines = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    asked = [*project["project"]["license-files"], project["project"]["readme"], *wheel["only-include"]]
    assert [name for name in asked if f"!{name}" not in lines] == []


def test_no_command_of_the_documentation_wants_one_python_of_many() -> None:
    """A fresh server has the Python of its system: 3.10 on Ubuntu 22.04, 3.12 on 24.04, 3.13 on Debian 13."""
    for page in sorted((ROOT / "docs").rglob("*.md")):
        assert not re.findall(r"python3\.\d+ -m venv", page.read_text(encoding="utf-8")), page.name


# ---- compose


def test_nobody_but_the_proxy_reaches_the_lab() -> None:
    assert LAB["network_mode"] == "service:proxy", "the proxy's loopback is the lab's"
    assert "ports" not in LAB and "expose" not in LAB
    assert PROXY["ports"] == ["80:80", "443:443"]
    assert "network_mode" not in PROXY
    assert never_listens_elsewhere(LAB["command"])
    assert serves(LAB["command"])["url"].startswith("https://${LAB_HOST:?")


@pytest.mark.parametrize("name", ["lab", "proxy"])
def test_a_container_may_do_no_more_than_it_needs(name: str) -> None:
    service = COMPOSE["services"][name]
    assert service["read_only"] is True and service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service.get("cap_add", []) == (["NET_BIND_SERVICE"] if name == "proxy" else [])
    assert "privileged" not in service and service["restart"] == "unless-stopped"


def test_data_outlive_the_containers_and_no_key_is_in_a_file_of_ours() -> None:
    assert LAB["volumes"] == ["data:/data"] and "certificates:/data" in PROXY["volumes"]
    assert set(COMPOSE["volumes"]) == {"data", "certificates"}
    assert str(serves(LAB["command"])["data"]).startswith("/data/")
    (mounted,) = (volume for volume in PROXY["volumes"] if volume.startswith("./"))
    assert (ROOT / mounted.split(":")[0]).is_file() and mounted.endswith(":ro")
    assert LAB["environment"]["SALAB_EXPERIMENTER_TOKEN"].startswith("${SALAB_EXPERIMENTER_TOKEN:?")


def test_what_is_printed_goes_nowhere_and_the_arguments_arrive(tmp_path: Path) -> None:
    """The links are keys; Docker keeps what a container prints."""
    (tmp_path / "salab").write_text('#!/bin/sh\necho "a link"\nprintf "%s;" "$@" >&2\n', encoding="utf-8")
    (tmp_path / "salab").chmod(0o755)
    entry = [part.replace("$$", "$") for part in LAB["entrypoint"]]
    ran = done([*entry, "serve", "--data=a folder"], PATH=f"{tmp_path}:/usr/bin:/bin")
    assert (ran.stdout, ran.stderr) == ("", "serve;--data=a folder;")


def test_the_lab_has_room_for_all_the_connections_that_it_takes() -> None:
    assert LAB["ulimits"]["nofile"] >= 2 * Limits().connections
    assert int(unit("shared-autonomy-lab.service")["Service"]["LimitNOFILE"]) >= 2 * Limits().connections


# ---- the proxy


def test_caddy_takes_its_configuration_and_finds_it_well_formatted(tmp_path: Path) -> None:
    path = str(SERVER / "Caddyfile")
    command = [tool("caddy"), "validate", "--adapter", "caddyfile", "--config", path]
    read = done(command, LAB_HOST="localhost", HOME=str(tmp_path), XDG_DATA_HOME=str(tmp_path))
    assert read.returncode == 0 and "Valid configuration" in read.stdout + read.stderr
    assert "warn" not in read.stderr.lower()


def test_the_proxy_is_no_wider_and_no_more_patient_than_the_lab() -> None:
    text = (SERVER / "Caddyfile").read_text(encoding="utf-8")
    (size,) = re.findall(r"max_size (\d+)MB", text)
    assert int(size) * 1_000_000 == LET_PASS * Limits().body_bytes
    (head,) = re.findall(r"max_header_size (\d+)KB", text)
    assert int(head) * 1000 <= Limits().head_bytes
    (kept_s,) = re.findall(r"keepalive (\d+)s", text)
    assert int(kept_s) < Limits().idle_s, "else a request may come to a connection that the lab is closing"
    assert f"{{$LAB_PORT:{LabConfig().port}}}" in text


# ---- systemd


def unit(name: str) -> dict[str, dict[str, str]]:
    """A unit's sections. Of a key that stands there twice the last counts, as for most of systemd's."""
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read_string((SERVER / name).read_text(encoding="utf-8"))
    return {section: dict(parser[section]) for section in parser.sections()}


def test_the_service_serves_on_loopback_from_a_folder_that_it_may_write_to() -> None:
    service = unit("shared-autonomy-lab.service")["Service"]
    command, *arguments = shlex.split(service["ExecStart"])
    assert command == PROGRAM and never_listens_elsewhere(arguments)
    assert str(serves(arguments)["data"]) == f"/var/lib/{service['StateDirectory']}/data"
    assert service["UMask"] == "0077" and service["StateDirectoryMode"] == "0700"
    assert service["StandardOutput"] == "null" and service["StandardError"] == "journal"
    assert service["EnvironmentFile"] and service["User"] not in ("", "root")
    assert "SALAB" not in " ".join(line for line in service.values())


def test_the_service_may_do_no_more_than_it_needs() -> None:
    service = unit("shared-autonomy-lab.service")["Service"]
    on = {key for key, value in service.items() if value == "yes"}
    assert on >= {"NoNewPrivileges", "ProtectHome", "PrivateTmp", "PrivateDevices", "RestrictSUIDSGID"}
    assert service["ProtectSystem"] == "strict" and service["CapabilityBoundingSet"] == ""
    assert (service["IPAddressDeny"], service["IPAddressAllow"]) == ("any", "localhost")
    assert "AF_UNIX" in service["RestrictAddressFamilies"], "the fork server is spoken with over such sockets"


def test_the_timer_asks_whether_the_process_answers_and_starts_the_right_service_anew() -> None:
    command = unit("shared-autonomy-lab-alive.service")["Service"]["ExecStart"]
    assert f"http://127.0.0.1:{LabConfig().port}{ALIVE}" in command and "--fail" not in command
    assert command.count("shared-autonomy-lab") == 2 and "shared-autonomy-lab.service" in UNITS
    subprocess.run(["/bin/sh", "-n", "-c", shlex.split(command)[2]], check=True)


def test_systemd_takes_the_units_and_rates_the_service_well(tmp_path: Path) -> None:
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("there is no systemd-analyze on this machine: the units are only parsed")
    for name in UNITS:
        text = (SERVER / name).read_text(encoding="utf-8").replace(PROGRAM, "/bin/true")
        (tmp_path / name).write_text(text, encoding="utf-8")
    read = done([analyze, "verify", "--man=no", *(str(tmp_path / name) for name in UNITS)])
    assert (read.returncode, read.stderr) == (0, "")
    rated = done(
        [analyze, "security", "--offline=yes", "--threshold=20", str(tmp_path / "shared-autonomy-lab.service")]
    )
    assert rated.returncode == 0, rated.stdout.splitlines()[-1]
