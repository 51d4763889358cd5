# Draws the maps of stability_map: where each method holds, and how it fails. SPDX-License-Identifier: Apache-2.0
"""python3 stability_map.py FOLDER_OF_CSV FOLDER_OF_PICTURES [MAP ...]"""
import csv
import math
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.colors import BoundaryNorm, ListedColormap  # noqa: E402
from matplotlib.patches import Patch  # noqa: E402
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator  # noqa: E402

METHODS = ["pgs", "tgs", "direct", "reduced"]
# From light to dark, so that they are told apart in grey as well.
CLASSES = {
    "holds": ("#e4f0f8", "holds: error up to 10⁻⁵, no energy gained"),
    "loose": ("#8cc6ea", "loose: error up to 10⁻²"),
    "open": ("#d39200", "open: error beyond 10⁻²"),
    "energy": ("#a8430a", "gains energy"),
    "fault": ("#101010", "fault: frozen"),
}
SOFT_CLASSES = {
    "holds": ("#e4f0f8", "as stated, within 10 %"),
    "damped": ("#8cc6ea", "as implicit Euler: the step is too long for the spring as stated"),
    "off": ("#d39200", "neither: sweeps have not converged"),
    "energy": ("#a8430a", "gains energy"),
    "fault": ("#101010", "fault: frozen"),
}
INK, GREY = "#222222", "#5c5c5c"

RATES = [1000, 500, 240, 120, 60, 30]
DECADES = [10.0 ** n for n in range(-4, 9)]
# Label, ticks, and how a tick is written.
AXES = {
    "sweeps": ("sweeps (tgs: sub-steps) per step", [1, 4, 16, 64, 256], "{:.0f}"),
    "followers": ("followers of one driver", [1, 4, 8, 12, 16, 20, 24], "{:.0f}"),
    "couplings": ("couplings in a row", [1, 4, 8, 12, 16, 20, 24], "{:.0f}"),
    "gear_ratio": ("gear ratio", DECADES, None),
    "mass_ratio": ("mass of the last links by that of the first", DECADES, None),
    "kp": ("servo stiffness kp (N m/rad)", DECADES, None),
    "initial_error": ("error of the couplings at the start (rad)", [0.001, 0.01, 0.1, 1], "{:g}"),
    "frequency": ("natural frequency as stated (Hz)", [0.5, 1, 2, 5, 10, 20, 50, 100], "{:g}"),
    "damping_ratio": ("damping ratio as stated", [0.01, 0.1, 1, 10], "{:g}"),
    "dt": ("step (s)", [1.0 / rate for rate in RATES], "1/{:.0f}"),
}
LINEAR = {"followers", "couplings"}
# The finding, and what was run.
TITLES = {
}


def tick_text(name, value):
    form = AXES[name][2]
    if form is None:
        return f"$10^{{{round(math.log10(value))}}}$"
    return form.format(1.0 / value if name == "dt" else value)


def edges(name, values):
    """Borders of the cells: half-way between neighbours, on the scale of the axis."""
    linear = name in LINEAR
    at = list(values) if linear else [math.log(value) for value in values]
    middle = [(a + b) / 2 for a, b in zip(at, at[1:])]
    border = [2 * at[0] - middle[0]] + middle + [2 * at[-1] - middle[-1]]
    return border if linear else [math.exp(value) for value in border]


def dress(axis, name):
    _, ticks, _ = AXES[name]
    low, high = sorted(axis.get_view_interval())
    axis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: tick_text(name, value)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def draw(path, picture):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    x, y = list(rows[0])[:2]
    found = {(row["method"], float(row[x]), float(row[y])): row["class"] for row in rows}
    ys = sorted({point[2] for point in found})
    xs = sorted({point[1] for point in found} - {0.0})  # 0 sweeps: the method makes none
    classes = SOFT_CLASSES if x == "damping_ratio" or y == "frequency" else CLASSES
    codes = list(classes)
    colors = ListedColormap([color for color, _ in classes.values()])

    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9.5, "axes.edgecolor": "#9a9a9a",
                         "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK})
    figure, panels = plt.subplots(1, 4, figsize=(12.5, 4.35), sharex=True, sharey=True)
    figure.subplots_adjust(left=0.065, right=0.99, top=0.75, bottom=0.135, wspace=0.06)
    for panel, method in zip(panels, METHODS):
        cells = [[codes.index(found.get((method, a, b)) or found[method, 0.0, b]) for a in xs] for b in ys]
        panel.pcolormesh(edges(x, xs), edges(y, ys), cells, cmap=colors, norm=BoundaryNorm(range(len(codes) + 1), len(codes)),
                         edgecolors="white", linewidth=0.3)
        panel.set_title(method, fontsize=11.5, color=INK, loc="left")
        panel.set_xscale("linear" if x in LINEAR else "log")
        panel.set_yscale("linear" if y in LINEAR else "log")
    dress(panels[0].xaxis, x)
    dress(panels[0].yaxis, y)
    for panel in panels:
        panel.tick_params(length=3)
    panels[0].set_ylabel(AXES[y][0])
    figure.supxlabel(AXES[x][0], fontsize=9.5, color=INK, y=0.015)
    title, scene = TITLES.get(path.stem, (path.stem, ""))
    figure.text(0.065, 0.945, title, fontsize=14, fontweight="bold", color=INK)
    figure.text(0.065, 0.895, scene, fontsize=9.5, color=GREY)
    present = set(found.values())
    figure.legend(handles=[Patch(facecolor=color, edgecolor="#9a9a9a", linewidth=0.5, label=words)
                           for key, (color, words) in classes.items() if key in present],
                  loc="upper left", bbox_to_anchor=(0.065, 0.885), ncol=len(present), frameon=False, fontsize=9.5,
                  borderaxespad=0, borderpad=0, handlelength=1.4, columnspacing=1.8)
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def main(tables, pictures, *names):
    Path(pictures).mkdir(parents=True, exist_ok=True)
    for path in sorted(Path(tables).glob("*.csv")):
        if not names or path.stem in names:
            draw(path, Path(pictures) / (path.stem + ".png"))


if __name__ == "__main__":
    main(*sys.argv[1:])
