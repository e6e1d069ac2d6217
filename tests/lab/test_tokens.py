"""The experimenter's token opens everything: one that can be guessed opens no lab."""

from __future__ import annotations

import secrets
from pathlib import Path

import pytest

from app.config import LabConfig
from app.errors import LabError
from app.lab.lab import Lab
from app.lab.tokens import check_strength, new_token
from tests.support.lab_server import EXPERIMENTER_TOKEN


@pytest.mark.parametrize(
    ("token", "told"),
    [
        ("letme1", "has 6 characters; it must have at least 24"),
        ("x" * 23, "has 23 characters"),
        ("a" * 64, "can be guessed: about 0 bits"),
        ("password" * 4, "can be guessed"),
        ("correcthorsecorrecthorsecorrecthorse", "can be guessed"),
        ("abcdefghijklmnopqrstuvwxyz0123456789", "can be guessed"),
        ("zyxwvutsrqponmlkjihgfedcba", "can be guessed"),
        ("1234567890" * 4, "can be guessed"),
        ("choose a long one, of your own please", "has characters other than"),
        ("schlüssel-" * 5, "has characters other than"),
    ],
)
def test_a_token_that_can_be_guessed_is_refused_with_how_to_make_one(token: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(LabError, match=told) as info:
        Lab(LabConfig(data_dir=tmp_path / "data"), token).prepare()
    assert "secrets.token_urlsafe(24)" in str(info.value)
    assert token not in str(info.value)  # it may have been meant as one, and a log is no place for it
    assert not (tmp_path / "data").exists()


def test_so_is_one_for_the_metrics(tmp_path: Path) -> None:
    with pytest.raises(LabError, match="the metrics' token has 6 characters"):
        Lab(LabConfig(data_dir=tmp_path / "data"), metrics_token="letme1").prepare()
    assert not (tmp_path / "data").exists()


def test_tokens_that_were_made_are_taken() -> None:
    for _ in range(2000):
        check_strength(new_token())
        check_strength(secrets.token_hex(16))
    check_strength(EXPERIMENTER_TOKEN)


def test_the_variable_of_the_environment_is_checked_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from app.__main__ import main

    monkeypatch.setenv("SALAB_EXPERIMENTER_TOKEN", "letmein")
    assert main(["serve", "--port", "0", "--data", str(tmp_path / "data"), "--robot", "kinematic"]) == 1
    assert "the experimenter's token has 7 characters" in capsys.readouterr().err
