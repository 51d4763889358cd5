# What `pip install .` calls (PEP 517): the library and the module, built by cmake, as a wheel. It downloads nothing;
# only npm, where it is, fetches the libraries of the page that plays recordings.
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import base64
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from typing import Any, Mapping, Optional

ROOT = pathlib.Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "wheel"  # kept, so that the next call compiles only what has changed


def project() -> tuple[str, str]:
    """Version and summary, from the project's one place."""
    lists = (ROOT / "CMakeLists.txt").read_text()
    found = re.search(r'project\(lockstep VERSION (\S+) .*?DESCRIPTION "([^"]+)"', lists, re.S)
    assert found, "CMakeLists.txt has no project(lockstep VERSION ... DESCRIPTION ...)"
    return found[1], found[2]


def install_package(prefix: str) -> None:
    """Builds the module and the shared library that it uses, and puts both into prefix/lockstep."""
    # pip hides the packages of the interpreter from this process; cmake asks the interpreter itself.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment.setdefault("CMAKE_BUILD_PARALLEL_LEVEL", str(os.cpu_count() or 1))
    if shutil.which("ninja"):
        environment.setdefault("CMAKE_GENERATOR", "Ninja")
    options = {
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_INSTALL_LIBDIR": "lockstep",  # beside the module
        "CMAKE_PLATFORM_NO_VERSIONED_SONAME": "ON",  # a wheel has no symbolic links
        "LOCKSTEP_BUILD_BENCH": "OFF",
        "LOCKSTEP_BUILD_PYTHON": "ON",
        "LOCKSTEP_BUILD_TESTS": "OFF",
        "LOCKSTEP_BUILD_TOOL": "OFF",
        "LOCKSTEP_PYTHON_DIR": ".",
        "Python_EXECUTABLE": sys.executable,
    }
    for arguments in (
        ["-S", str(ROOT), "-B", str(BUILD), *(f"-D{name}={value}" for name, value in options.items())],
        ["--build", str(BUILD), "--target", "lockstep_python"],
        ["--install", str(BUILD), "--prefix", prefix, "--component", "python", "--strip"],
    ):
        subprocess.run(["cmake", *arguments], check=True, env=environment)


def build_wheel(
    wheel_directory: str, config_settings: Optional[Mapping[str, Any]] = None, metadata_directory: Optional[str] = None
) -> str:
    version, summary = project()
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{re.sub('[-.]', '_', sysconfig.get_platform())}"
    information = f"lockstep-{version}.dist-info"
    with tempfile.TemporaryDirectory() as prefix:
        install_package(prefix)
        files = {str(path.relative_to(prefix)): path.read_bytes()
                 for path in sorted(pathlib.Path(prefix).rglob("*")) if path.is_file()}
    files[f"{information}/METADATA"] = "\n".join([
        "Metadata-Version: 2.1", "Name: lockstep", f"Version: {version}", f"Summary: {summary}", "License: Apache-2.0",
        "Requires-Python: >=3.9", "Requires-Dist: numpy", ""]).encode()
    files[f"{information}/WHEEL"] = "\n".join([
        "Wheel-Version: 1.0", "Generator: lockstep", "Root-Is-Purelib: false", f"Tag: {tag}", ""]).encode()
    record = f"{information}/RECORD"
    lines = [f"{name},sha256={base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip('=')},{len(data)}"
             for name, data in files.items()]
    files[record] = "\n".join([*lines, f"{record},,", ""]).encode()
    wheel = f"lockstep-{version}-{tag}.whl"
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return wheel
