# The stubs agree with the module, and the package with its stubs. SPDX-License-Identifier: Apache-2.0
import os
import pathlib
import subprocess
import sys

import pytest

import lockstep

PACKAGE = pathlib.Path(lockstep.__file__).parent


def run(*arguments, tmp_path):
    environment = {**os.environ, "MYPYPATH": str(PACKAGE.parent), "MYPY_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-m", *arguments], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_stubs_describe_the_module(tmp_path):
    pytest.importorskip("mypy")
    own_to_pybind = tmp_path / "allowed"
    own_to_pybind.write_text("lockstep._lockstep.(Batch|Plan|Rows|_Motion)(.__init__)?\n")
    run("mypy.stubtest", "lockstep._lockstep", "--ignore-missing-stub", "--allowlist", str(own_to_pybind),
        tmp_path=tmp_path)


def test_the_package_is_typed(tmp_path):
    pytest.importorskip("mypy")
    run("mypy", "--strict", "--ignore-missing-imports", "-p", "lockstep", tmp_path=tmp_path)


def test_programs_are_checked(tmp_path):
    pytest.importorskip("mypy")
    program = tmp_path / "program.py"
    program.write_text("import lockstep as ls\nls.compile(ls.Model(), dt='fast')\n")
    with pytest.raises(AssertionError, match="incompatible type"):
        run("mypy", str(program), tmp_path=tmp_path)


def test_everything_public_is_documented():
    for name in lockstep.__all__:
        thing = getattr(lockstep, name)
        if name in ("__version__", "infinity", "Softness"):
            continue
        assert thing.__doc__, name
        for attribute in vars(thing) if isinstance(thing, type) else ():
            if not attribute.startswith("_") and callable(getattr(thing, attribute)):
                assert getattr(thing, attribute).__doc__ or name not in ("Batch", "Plan"), f"{name}.{attribute}"
