# Reads the rows of the benchmarks' tables by the names that documents use. SPDX-License-Identifier: Apache-2.0
import csv
import re
from typing import NamedTuple

SCENES = ["chain8", "gripper13", "chain32"]

# Words of older tables, and the words that replace them.
RENAMED = [(r"/(?:kernel|engine):", "/engine:"), (r"/astray\b", "/inconsistent"), (r"-idle\b", "-inactive"),
           (r"-acting\b", "-active")]


class Rate(NamedTuple):
    speed: float   # million environment-steps per second; the fastest repeat where there is one
    gflops: float
    flops: str     # per step
    median: float  # million environment-steps per second


def read(path):
    """The rows of a CSV file; none if there is no such file."""
    if not path.exists():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def row_name(name):
    """A row's name and its statistic. The name is without the statistic and the benchmark library's suffixes."""
    name, statistic = re.fullmatch(r"(.*?)(_median|_best)?", name).groups()
    name = re.sub("/real_time$|/iterations:[0-9]+", "", name)
    for old, new in RENAMED:
        name = re.sub(old, new, name)
    return name, statistic


def rates(table):
    """Rate by name. Speeds are medians; where threads are compared, the fastest repeat. Single repeats have no
    statistic."""
    found, medians = {}, {}
    for row in table:
        if not row["env_steps_per_second"]:
            continue
        name, statistic = row_name(row["name"])
        speed = float(row["env_steps_per_second"]) * 1e-6
        if statistic != "_best":
            medians[name] = speed
        if statistic == "_best" or name not in found:
            found[name] = Rate(speed, float(row["gflops"]), row["flops_per_step"], speed)
    return {name: rate._replace(median=medians.get(name, rate.speed)) for name, rate in found.items()}
