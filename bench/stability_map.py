# Draws the maps of stability_map: where each method is stable, and how it fails. SPDX-License-Identifier: Apache-2.0
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
# From light to dark, so that they differ in grey too.
CLASSES = {
    "holds": ("#e4f0f8", "holds: coupling error ≤ 10⁻⁵"),
    "loose": ("#8cc6ea", "loose: ≤ 10⁻²"),
    "open": ("#d39200", "open: larger"),
    "energy": ("#a8430a", "gains energy"),
    "fault": ("#101010", "frozen by a fault"),
}
SOFT_CLASSES = {
    "holds": ("#e4f0f8", "as stated, within 10 %"),
    "damped": ("#8cc6ea", "more damped, as implicit Euler damps"),
    "off": ("#d39200", "neither: too few sweeps"),
    "energy": ("#a8430a", "gains energy"),
    "fault": ("#101010", "frozen by a fault"),
}
INK, GREY = "#222222", "#5c5c5c"

DECADES = [10.0 ** n for n in range(-6, 9, 2)]
# Label, ticks, and how a tick is written; None: as a power of ten.
AXES = {
    "sweeps": ("sweeps per step (of tgs: sub-steps)", [1, 4, 16, 64, 256], "{:.0f}"),
    "followers": ("followers of one leader", [1, 5, 10, 15, 20], "{:.0f}"),
    "couplings": ("couplings in a row", [1, 5, 10, 15, 20], "{:.0f}"),
    "gear_ratio": ("gear ratio", [1e-3, 1e-1, 1e1, 1e3], None),
    "mass_ratio": ("mass of the last links, of the first", DECADES, None),
    "damping": ("damping of each joint (N m s/rad)", [1e-4, 1e-3, 1e-2, 1e-1, 1], None),
    "kp": ("stiffness of the servo (N m/rad)", DECADES, None),
    "initial_error": ("error at the start (rad)", [0.001, 0.01, 0.1, 1, 10], "{:g}"),
    "frequency": ("natural frequency stated (Hz)", [0.5, 1, 2, 5, 10, 20, 50, 100], "{:g}"),
    "damping_ratio": ("damping ratio stated", [0.03, 0.1, 0.3, 1, 3], "{:g}"),
    "dt": ("step (s)", [1 / 960, 1 / 480, 1 / 240, 1 / 120, 1 / 60], "1/{:.0f}"),
}
LINEAR = {"followers", "couplings"}
# Title and subtitle: the finding, and what was run.
TITLES = {
    "followers_sweeps": ("A star of couplings needs more sweeps the more followers it has",
                         "One servo and its followers, all of one mass, 1/240 s"),
    "chain_sweeps": ("A long chain of couplings is out of reach of sweeps: twice the length needs eight times as many",
                     "Serial arm in gravity, each joint mimics the one before, 1/240 s"),
    "gear_sweeps": ("Gear ratios: pgs needs four to eight sweeps, tgs hundreds, and direct in float ends at 10⁴",
                    "Arm of 8 joints, 4 couplings, 1/240 s"),
    "mass_dt": ("Twelve decades of mass: exact methods cope, sweeps do not cope with heavy last links",
                "Arm of 8 joints, 4 couplings, damping in proportion to the masses, 4 sweeps"),
    "mass_gear": ("Mass and gear ratio together: reduced holds everywhere, direct in float up to ratios of 10³",
                  "Arm of 8 joints, 4 couplings, damping in proportion to the masses, 1/240 s, 4 sweeps"),
    "damping_dt": ("The limit of the integrator: with little damping every method needs small steps",
                   "Arm of 8 joints, 4 couplings, free fall from rest, 4 sweeps"),
    "stiffness_dt": ("No servo is too stiff, but a jump to its target at 200 rad/s can be too fast for the step",
                     "Arm of 8 joints, 4 couplings, servo on the first joint 0.3 rad off its target, 4 sweeps"),
    "error_dt": ("A start with large coupling errors: sweeps leave the speed of the correction in the motion",
                 "Arm of 8 joints, 4 couplings, the same error in all, 4 sweeps"),
    "frequency_dt": ("Soft couplings are as stated while the step resolves them; beyond that they are more damped",
                     "One slider and four that follow it, damping ratio 0.1, 4 sweeps"),
    "frequency_damping": ("Soft couplings at 1/240 s: as stated up to 5 Hz, tgs with four sub-steps to 20 Hz",
                          "One slider and four that follow it, 4 sweeps"),
}


def tick_text(name, value):
    pattern = AXES[name][2]
    if pattern is None:
        return f"$10^{{{round(math.log10(value))}}}$"
    return pattern.format(1.0 / value if name == "dt" else value)


def edges(name, values):
    """Borders of the cells, half-way between neighbours on the scale of the axis."""
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
    xs = sorted({point[1] for point in found} - {0.0})  # 0 sweeps: the method does not sweep
    classes = SOFT_CLASSES if x == "damping_ratio" or y == "frequency" else CLASSES
    codes = list(classes)
    colors = ListedColormap([color for color, _ in classes.values()])

    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9.5, "axes.edgecolor": "#9a9a9a",
                         "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK})
    figure, panels = plt.subplots(1, 4, figsize=(10.4, 4.1), sharex=True, sharey=True)
    figure.subplots_adjust(left=0.07, right=0.99, top=0.745, bottom=0.135, wspace=0.06)
    for panel, method in zip(panels, METHODS):
        cells = [[codes.index(found.get((method, a, b)) or found[method, 0.0, b]) for a in xs] for b in ys]
        panel.pcolormesh(edges(x, xs), edges(y, ys), cells, cmap=colors, edgecolors="white", linewidth=0.15,
                         norm=BoundaryNorm(range(len(codes) + 1), len(codes)))
        sweepless = x == "sweeps" and (method, 0.0, ys[0]) in found
        panel.set_title(method + (" (does not sweep)" if sweepless else ""), fontsize=11, color=INK, loc="left")
        panel.set_xscale("linear" if x in LINEAR else "log")
        panel.set_yscale("linear" if y in LINEAR else "log")
    dress(panels[0].xaxis, x)
    dress(panels[0].yaxis, y)
    for panel in panels:
        panel.tick_params(length=3)
    panels[0].set_ylabel(AXES[y][0])
    figure.supxlabel(AXES[x][0], fontsize=9.5, color=INK, y=0.015)
    title, scene = TITLES.get(path.stem, (path.stem, ""))
    figure.text(0.07, 0.945, title, fontsize=12.5, fontweight="bold", color=INK)
    figure.text(0.07, 0.895, scene, fontsize=9.5, color=GREY)
    present = set(found.values())
    figure.legend(handles=[Patch(facecolor=color, edgecolor="#9a9a9a", linewidth=0.5, label=words)
                           for key, (color, words) in classes.items() if key in present],
                  loc="upper left", bbox_to_anchor=(0.07, 0.872), ncol=len(present), frameon=False, fontsize=9.5,
                  borderaxespad=0, borderpad=0, handlelength=1.4, columnspacing=1.8)
    figure.savefig(picture, dpi=130)
    plt.close(figure)


def main(tables, pictures, *names):
    Path(pictures).mkdir(parents=True, exist_ok=True)
    for path in sorted(Path(tables).glob("*.csv")):
        if not names or path.stem in names:
            draw(path, Path(pictures) / (path.stem + ".png"))


if __name__ == "__main__":
    main(*sys.argv[1:])
