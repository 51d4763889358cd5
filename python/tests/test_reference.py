# docs/python.md says what the package says of itself, and its programs run. SPDX-License-Identifier: Apache-2.0
import inspect
import pathlib
import re
import subprocess
import sys

import pytest

import lockstep as ls

ROOT = pathlib.Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
import reference  # noqa: E402


def test_the_reference_is_what_the_docstrings_say():
    done = subprocess.run([sys.executable, DOCS / "reference.py", "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_quantity_is_in_the_table_of_queries(batch):
    with pytest.raises(ls.UsageError) as error:
        batch.read("nonsense")
    known = error.value.remedy.removeprefix("give one of: ").split(", ")
    told = [name for names, _, _ in reference.query_rows(inspect.getdoc(ls.Query)) for name in names.split(", ")]
    assert sorted(told) == sorted(known)


def test_the_programs_of_the_page_run(monkeypatch):
    monkeypatch.chdir(ROOT)
    programs = re.findall(r"```python\n(.*?)```", (DOCS / "python.md").read_text(), re.S)
    assert len(programs) >= 3
    names = {}
    for program in programs:  # each goes on where the last has ended
        exec(compile(program, "docs/python.md", "exec"), names)
    assert names["tips"].shape == (64, 3 + 2 * names["plan"].nv)
    assert names["seen"]["policy"].shape == (64, 6 * names["plan"].nv)
    assert names["records"].shape == (256, 12, names["plan"].nv + 3) and not names["faults"].any()
    assert names["step"]["A"].shape[0] == 2 and names["left"].shape == (2, 2)


def test_every_example_is_in_the_index():
    index = (DOCS / "examples" / "python" / "README.md").read_text()
    for program in (DOCS / "examples" / "python").glob("*.py"):
        assert f"`{program.name}`" in index, program.name
