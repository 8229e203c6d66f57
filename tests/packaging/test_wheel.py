"""The wheel alone, in an environment of its own, is the whole product: under names of ours, with page and demos."""

import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterator
from pathlib import Path
from shutil import copy2

import httpx
import pytest
from waiting import wait_until

import lidarcore

ROOT = Path(__file__).parents[2]
BUILD = "import sys; from setuptools.build_meta import build_wheel; print(build_wheel(sys.argv[1]))"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built of what git knows, elsewhere: building leaves things about."""
    source, output = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    names = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0")
    for name in filter(None, names):
        if not name.startswith("tests/") and (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            copy2(ROOT / name, source / name)
    subprocess.run([sys.executable, "-c", BUILD, output], cwd=source, check=True, capture_output=True)
    (built,) = output.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new one with the wheel in it. What the wheel depends on is borrowed: installing it takes minutes.

    A folder that is borrowed by a .pth file brings its packages, but not the editable install of this checkout, which
    is another .pth file.
    """
    folder = tmp_path_factory.mktemp("installed") / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--no-deps", "--no-index", wheel], check=True)
    (site_packages(folder) / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder


def site_packages(environment: Path) -> Path:
    (folder,) = environment.glob("lib/python*/site-packages")
    return folder


@pytest.fixture(scope="module")
def url(environment: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where the installed server answers; compiled kernels are those of this checkout if they are of the same code."""
    folder = tmp_path_factory.mktemp("work")
    demo = site_packages(environment) / "lidarcore_app" / "demo" / "real-rplidar-windsor.npz"
    kernels = Path(lidarcore.__file__).parent / "__pycache__" / "kernels"
    command = [environment / "bin" / "lidarcore", "serve", demo, "--http-port", "0"]
    variables = os.environ | {"NUMBA_CACHE_DIR": str(kernels)}
    with subprocess.Popen(
        command, cwd=folder, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        said = [process.stdout.readline()]
        while said[-1] and not re.search(r"http://\S+", said[-1]):
            said.append(process.stdout.readline())
        address = re.search(r"http://[^\s/]+", said[-1])
        assert address, "".join(said)
        yield address[0]
        process.terminate()


def test_everything_is_under_names_of_ours(environment: Path) -> None:
    ours = {path.name for path in site_packages(environment).iterdir() if path.name != "borrowed.pth"}
    (version,) = (name for name in ours if name.endswith(".dist-info"))
    assert ours == {"lidarcore", "lidarcore_app", version}


def test_the_wheel_brings_page_demos_and_licences(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    for path in (
        "static/index.html",
        "static/js/main.js",
        "demo/emulated-s1.mcap",
        "demo/real-rplidar-windsor.npz",
        "demo/LICENSE-windsor.txt",
    ):
        assert f"lidarcore_app/{path}" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert {name.split("/")[0].partition("-")[0] for name in names} == {"lidarcore", "lidarcore_app"}


def test_the_installed_server_reads_a_scan_and_serves_its_page(environment: Path, url: str) -> None:
    with httpx.Client(base_url=url, timeout=60) as http:
        wait_until(lambda: http.get("/api/v1/health").json()["ready"], "it is ready", 240)
        wait_until(lambda: http.get("/api/v1/frame").is_success, "it has read a scan")
        frame = http.get("/api/v1/frame", params={"points": True}).json()
        assert len(frame["points"]) > 100
        assert http.get("/api/v1/source").json()["recording"] == "real-rplidar-windsor.npz"
        assert "static/js/main.js" in http.get("/").text
        assert http.get("/static/js/main.js").is_success


def test_nothing_is_taken_from_the_checkout(environment: Path) -> None:
    code = "import lidarcore, lidarcore_app; print(lidarcore.__file__, lidarcore_app.__file__)"
    said = subprocess.check_output([environment / "bin" / "python", "-c", code], cwd=environment, text=True)
    assert all(Path(name).is_relative_to(environment) for name in said.split())
