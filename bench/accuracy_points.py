# The rows of accuracy.csv. SPDX-License-Identifier: Apache-2.0
"""What accuracy.py draws and result_pages.py writes: one row is an engine with its settings at one step size."""
import csv
import math
from collections import defaultdict

# Beyond this a row is no result: off by a radian, or by the whole energy. Momentum has no size of its own.
MOST = defaultdict(lambda: 1.0, momentum_change=math.inf)


def read(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for key in set(row) - {"engine", "scene", "settings"}:
            row[key] = float(row[key])
    return rows


def good(row, column):
    return not row["diverged"] and math.isfinite(row[column]) and row[column] < MOST[column]


def cost(row):
    return row["cost_us_per_env_second"]
