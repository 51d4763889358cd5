# Measures and draws error against cost of lockstep and other engines. SPDX-License-Identifier: Apache-2.0
"""Runs accuracy_speed of a build, writes bench/results/MACHINE/accuracy.csv and draws docs/accuracy/*.png. With --draw
it draws earlier measurements. result_pages.py writes docs/results/accuracy.md."""
import argparse
import math
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

from accuracy_points import cost, good, read  # noqa: E402
from measure import RESULTS, machine  # noqa: E402

BENCH = Path(__file__).resolve().parent
SCENES = {
    "chain8": "chain8: arm of 8 joints, 4 couplings, damped",
    "gripper13": "gripper13: arm and gripper of 13 joints, 5 couplings, stiff servos that move",
    "chain32": "chain32: floating whip of 32 joints, 16 couplings, 908 J",
}
INK, GREY, LINE = "#222222", "#5c5c5c", "#d5d5d5"
# Settings that are drawn, in the order of the legend: engine, settings, label, colour, marker, dashes. Other rows of
# the table (sparse or dense, CG or PGS) are as good as these or worse.
LINES = [
    ("lockstep", "euler, f32", "lockstep Euler", "#0072B2", "o", "-"),
    ("lockstep", "leapfrog, f32", "lockstep leapfrog", "#E69F00", "v", "-"),
    ("lockstep", "extrapolated, f32", "lockstep extrapolated", "#56B4E9", "P", "-"),
    ("lockstep", "extrapolated, f64", "lockstep extrapolated, f64", "#56B4E9", "P", "--"),
    ("lockstep", "runge_kutta, f32", "lockstep Runge-Kutta 4", "#222222", "X", "-"),
    ("lockstep", "runge_kutta, f64", "lockstep Runge-Kutta 4, f64", "#222222", "X", "--"),
    ("lockstep", "pgs 4, f32", "lockstep Euler, pgs 4", "#CC79A7", "^", "-"),
    ("lockstep", "tgs 4, f32", "lockstep Euler, tgs 4", "#009E73", "D", "-"),
    ("MuJoCo", "default", "MuJoCo as it comes", "#b0b0b0", "s", "-"),
    ("MuJoCo", "stiff: Euler, Newton once, dense", "MuJoCo Euler, stiff", "#8a8a8a", "<", "-"),
    ("MuJoCo", "stiff: implicit, Newton once, dense", "MuJoCo implicit, stiff", "#8a8a8a", ">", ":"),
    ("MuJoCo", "stiff: RK4, Newton once, dense", "MuJoCo Runge-Kutta 4, stiff", "#5c5c5c", "x", "-"),
    ("Bullet", "pgs 50, f64", "Bullet, pgs 50", "#a8430a", "h", "-"),
    ("Simbody", "semi-explicit Euler, f64", "Simbody Euler", "#7b3294", "*", ":"),
    ("Simbody", "Runge-Kutta-Merson, 1e-3, f64", "Simbody RK-Merson, 1e-3", "#7b3294", "*", "-"),
]
PANELS = [("rms", "Error of the joints over one second, RMS (rad)"), ("largest_c", "Largest coupling error |C| (rad)")]

plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9.5, "axes.edgecolor": "#9a9a9a",
                     "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK,
                     "axes.spines.top": False, "axes.spines.right": False})


def front(rows, column):
    """The rows that no other row beats in both cost and error."""
    best, result = math.inf, []
    for row in sorted(rows, key=cost):
        if row[column] < 0.98 * best:
            best = row[column]
            result.append(row)
    return result


def drawn(row):
    return any(row["engine"].startswith(engine) and row["settings"] == settings for engine, settings, *_ in LINES)


def draw_panel(axes, rows, column, floor):
    for engine, settings, label, color, marker, dashes in LINES:
        line = sorted((row for row in rows if row["engine"].startswith(engine) and row["settings"] == settings
                       and good(row, column)), key=cost)
        if line:
            own = engine == "lockstep"
            axes.plot([cost(row) for row in line], [max(row[column], floor) for row in line], color=color,
                      marker=marker, linestyle=dashes, label=label, linewidth=1.9 if own else 1.2,
                      markersize=6 if own else 5.5, markerfacecolor="white" if dashes == "--" else color,
                      zorder=5 if own else 3)
    best = front([row for row in rows if good(row, column) and drawn(row)], column)
    axes.plot([cost(row) for row in best], [max(row[column], floor) for row in best], linestyle="none", marker="o",
              markersize=12, markerfacecolor="none", markeredgecolor=INK, markeredgewidth=0.9, zorder=6,
              label="front: no other is cheaper and better")
    if any(row[column] == 0 for row in rows):
        axes.annotate("exactly 0", (0.99, floor), xycoords=("axes fraction", "data"), xytext=(0, 5), ha="right",
                      textcoords="offset points", color=GREY, fontsize=9)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(True, which="major", color="#e8e8e8", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.set_xlabel("CPU time per environment and simulated second, one thread (µs)")


def draw(rows, scene, path):
    rows = [row for row in rows if row["scene"] == scene]
    figure, panels = plt.subplots(1, 2, figsize=(13.5, 6.3))
    figure.subplots_adjust(left=0.055, right=0.80, top=0.83, bottom=0.1, wspace=0.17)
    figure.text(0.055, 0.955, f"Error against cost: {scene}", fontsize=16, fontweight="bold", color=INK)
    peak = rows[0]["peak_gflops"]
    words = SCENES[scene].split(": ")[1] if scene in SCENES else "a robot from its URDF file, without its bounds"
    figure.text(0.055, 0.915, f"{words}. One second, steps of 1/60 to 1/1920 s (others 1/240 to "
                f"1/3840 s), all in one run; tables, AVX2, peak {peak:.0f} Gflop/s", fontsize=10, color=GREY)
    for axes, (column, title) in zip(panels, PANELS):
        floor = 3e-17 if column == "largest_c" else 0.0
        draw_panel(axes, rows, column, floor)
        axes.set_title(title, loc="left", fontsize=11, color=INK)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.805, 0.84), frameon=False, fontsize=9)
    failed = defaultdict(list)
    for row in rows:
        for engine, settings, label, *_ in LINES:
            if row["engine"].startswith(engine) and row["settings"] == settings and not good(row, "rms"):
                failed[label].append(f"1/{row['steps_per_second']:.0f}")
    if failed:
        text = "Diverged, or off by more than 1 rad:\n" + "\n".join(
            f"{label}: {', '.join(steps)}" for label, steps in failed.items())
        figure.text(0.808, 0.1, text, fontsize=7.8, color=GREY, va="bottom", wrap=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_energy(rows, path):
    figure, panels = plt.subplots(1, 2, figsize=(13.5, 5.6))
    figure.subplots_adjust(left=0.055, right=0.80, top=0.82, bottom=0.11, wspace=0.17)
    figure.text(0.055, 0.945, "Energy and momentum of the whip (chain32) after one second", fontsize=15,
                fontweight="bold", color=INK)
    figure.text(0.055, 0.895, "Error of the energy, and change of the momentum, which should not change. Engines that "
                "give their velocities", fontsize=10, color=GREY)
    whip = [row for row in rows if row["scene"] == "chain32"]
    titles = [("energy_error", "Error of the energy, share of 908 J"),
              ("momentum_change", "Change of momentum, largest component (N s, N m s)")]
    for axes, (column, title) in zip(panels, titles):
        draw_panel(axes, [row for row in whip if math.isfinite(row[column])], column, 1e-12)
        axes.set_title(title, loc="left", fontsize=11, color=INK)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.805, 0.84), frameon=False, fontsize=9)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=BENCH.parent / "build")
    parser.add_argument("--pictures", type=Path, default=BENCH.parent / "docs" / "accuracy")
    parser.add_argument("--robots", nargs="*", type=Path, default=[], help="URDF files to measure as well")
    parser.add_argument("--least-mass", default="0", help="least mass of the robots' bodies, kg")
    parser.add_argument("--least-inertia", default="0", help="least principal moments of the robots' bodies, kg m^2")
    parser.add_argument("--draw", metavar="MACHINE", help="only draw bench/results/MACHINE/accuracy.csv")
    choices = parser.parse_args()
    results = (RESULTS / choices.draw if choices.draw else machine()) / "accuracy.csv"
    if not choices.draw:
        robots = ["--robots", ",".join(map(str, choices.robots)), "--least-mass", choices.least_mass,
                  "--least-inertia", choices.least_inertia] if choices.robots else []
        program = choices.build / "bench" / "accuracy" / "accuracy_speed"
        subprocess.run([str(program), "--csv", str(results), *robots], check=True)
    rows = read(results)
    choices.pictures.mkdir(parents=True, exist_ok=True)
    for scene in dict.fromkeys(row["scene"] for row in rows):
        draw(rows, scene, choices.pictures / f"{scene}.png")
    draw_energy(rows, choices.pictures / "energy.png")


if __name__ == "__main__":
    sys.exit(main())
