"""What a container is given: control groups of both versions, of the process and of all above it."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.container import free_memory_bytes, given_cores, given_memory_bytes

GB = 1 << 30


def tree(folder: Path, own: str, files: dict[str, str]) -> tuple[Path, Path]:
    (folder / "own").write_text(own, encoding="ascii")
    for name, text in files.items():
        path = folder / "groups" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="ascii")
    return folder / "own", folder / "groups"


def test_a_container_of_version_2_sees_its_group_as_the_uppermost(tmp_path: Path) -> None:
    place = tree(tmp_path, "0::/\n", {"cpu.max": "150000 100000", "memory.max": str(2 * GB), "memory.current": str(GB)})
    assert given_cores(*place) == 1.5
    assert (given_memory_bytes(*place), free_memory_bytes(*place)) == (2 * GB, GB)


def test_the_least_of_a_services_group_and_those_above_it_counts(tmp_path: Path) -> None:
    files = {
        "lab.slice/cpu.max": "400000 100000",
        "lab.slice/salab.service/cpu.max": "max 100000",
        "lab.slice/memory.max": str(4 * GB),
        "lab.slice/memory.current": str(3 * GB),
        "lab.slice/salab.service/memory.max": str(3 * GB),
        "lab.slice/salab.service/memory.current": str(GB),
    }
    place = tree(tmp_path, "0::/lab.slice/salab.service\n", files)
    assert given_cores(*place) == 4.0
    assert (given_memory_bytes(*place), free_memory_bytes(*place)) == (3 * GB, GB)


@pytest.mark.parametrize(
    ("folder", "limit", "used", "stat"),
    [
        ("", "memory.max", "memory.current", f"anon 5\ninactive_file {GB}\nactive_file 7"),
        ("memory/", "memory.limit_in_bytes", "memory.usage_in_bytes", f"inactive_file 3\ntotal_inactive_file {GB}"),
    ],
)
def test_a_file_that_was_read_once_takes_no_memory_from_anybody(
    tmp_path: Path, folder: str, limit: str, used: str, stat: str
) -> None:
    own = "4:memory:/\n" if folder else "0::/\n"
    files = {folder + limit: str(2 * GB), folder + used: str(2 * GB), f"{folder}memory.stat": stat}
    assert free_memory_bytes(*tree(tmp_path, own, files)) == GB


def test_half_of_what_is_told_of_processor_time_tells_nothing(tmp_path: Path) -> None:
    place = tree(tmp_path, "3:cpu:/\n", {"cpu/cpu.cfs_quota_us": "50000"})
    assert given_cores(*place) is None


def test_version_1_has_a_folder_for_each_controller(tmp_path: Path) -> None:
    files = {
        "cpu,cpuacct/docker/ab/cpu.cfs_quota_us": "50000",
        "cpu,cpuacct/docker/ab/cpu.cfs_period_us": "100000",
        "cpu,cpuacct/cpu.cfs_quota_us": "-1",
        "cpu,cpuacct/cpu.cfs_period_us": "100000",
        "memory/memory.limit_in_bytes": str(GB),
        "memory/memory.usage_in_bytes": str(2 * GB),
    }
    place = tree(tmp_path, "9:name=systemd:/\n4:memory:/docker/ab\n3:cpu,cpuacct:/docker/ab\n", files)
    assert given_cores(*place) == 0.5
    assert (given_memory_bytes(*place), free_memory_bytes(*place)) == (GB, 0)


@pytest.mark.parametrize(
    ("own", "files"),
    [
        ("", {}),
        ("0::/\n", {"cpu.max": "max 100000", "memory.max": "max", "memory.current": "5"}),
        ("4:memory:/\n3:cpu:/\n", {"memory/memory.limit_in_bytes": "9223372036854771712"}),
    ],
)
def test_where_nothing_is_limited_nothing_is_told(tmp_path: Path, own: str, files: dict[str, str]) -> None:
    place = tree(tmp_path, own, files)
    assert given_cores(*place) is given_memory_bytes(*place) is free_memory_bytes(*place) is None
