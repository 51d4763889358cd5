#!/usr/bin/env python3
# Draws what bounded_accuracy prints: bounded_accuracy | bounded_accuracy.py PICTURE. SPDX-License-Identifier: Apache-2.0
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

rows = list(csv.DictReader(sys.stdin))
scenes = list(dict.fromkeys(row["scene"] for row in rows))
figure, panels = plt.subplots(2, 2, figsize=(8.5, 6), layout="constrained")
for scene, axes in zip(scenes, panels.flat):
    for integrator in ("euler", "leapfrog"):
        own = [row for row in rows if row["scene"] == scene and row["integrator"] == integrator]
        cost, error = ([float(row[key]) for row in own] for key in ("cost_us", "error"))
        axes.loglog(cost, error, marker="o", label=integrator)
        for row, x, y in zip(own, cost, error):
            axes.annotate(row["rate"], (x, y), textcoords="offset points", xytext=(4, 4), fontsize=7)
    axes.set(title=scene, xlabel="us of CPU time for a second", ylabel="RMS error of the joints")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
figure.savefig(sys.argv[1], dpi=110)
