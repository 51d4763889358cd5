# The learning example runs, and its numbers do not depend on threads. SPDX-License-Identifier: Apache-2.0
import pathlib
import re
import subprocess
import sys

EXAMPLE = pathlib.Path(__file__).parents[2] / "docs" / "examples" / "python" / "train_es.py"


def medians(threads):
    done = subprocess.run([sys.executable, EXAMPLE, "--generations", "10", "--threads", str(threads)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [float(number) for number in re.findall(r"median error +([0-9.]+) mm", done.stdout)]


def test_it_learns_the_same_with_one_thread_and_two():
    one = medians(1)
    assert one == medians(2)
    assert one[0] > 250 and one[-1] < 0.5 * one[0]
