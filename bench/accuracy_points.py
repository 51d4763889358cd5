# Reads the rows of accuracy.csv. SPDX-License-Identifier: Apache-2.0
"""For accuracy.py and result_pages.py. A row is one engine with its settings at one step size."""
import csv
import math
from collections import defaultdict

# A row with a larger error is not a result: it is off by a radian, or by the whole energy. Momentum has no such limit.
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
