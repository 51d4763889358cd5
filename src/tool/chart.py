# Draws the table of `lockstep chart`: error against cost. SPDX-License-Identifier: Apache-2.0
"""python3 chart.py TABLE.csv PICTURE.svg CAPTION, where CAPTION is JSON with the keys used below.

The command runs this by itself; it is a file of its own so that a table can be drawn anew."""
import csv
import json
import math
import sys
import textwrap

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402

# Okabe and Ito's palette: told apart by all eyes, and the markers differ too.
METHODS = {
    "reduced": ("#0072B2", "o"),
    "direct": ("#D55E00", "s"),
    "tgs": ("#009E73", "D"),
    "pgs": ("#CC79A7", "^"),
}
INK, FAINT = "#222222", "#8a8a8a"


def read(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for key, value in row.items():
            if key not in ("method", "precision"):
                row[key] = float(value)
    return rows


def families(rows):
    """Lines to draw: methods with sweeps by step size, the others by precision."""
    groups = {}
    for row in rows:
        swept = row["iterations"] > 0
        groups.setdefault((row["method"], row["precision"], row["dt"] if swept else None), []).append(row)
    for key, members in groups.items():
        yield key, sorted(members, key=lambda row: (row["iterations"], -row["dt"]))


def front(points):
    """Those that no other point beats in both cost and error."""
    best, result = math.inf, []
    for cost, error in sorted(points):
        if error < best:
            best = error
            result.append((cost, error))
    return result


def floor_of(values):
    """Where exact zeros are shown on a logarithmic axis: a decade and a half below the smallest other."""
    positive = [value for value in values if value > 0]
    return 10 ** (math.floor(math.log10(min(positive))) - 1.5) if positive else 1e-16


def draw_panel(axes, rows, column):
    floor = floor_of([row[column] for row in rows])
    zeros = any(row[column] == 0 for row in rows)

    def height(row):
        return row[column] if row[column] > 0 else floor

    for (method, precision, dt), members in families(rows):
        color, marker = METHODS[method]
        hollow = precision == "f64"
        axes.plot([row["cost_us_per_env_second"] for row in members], [height(row) for row in members],
                  color=color, marker=marker, linewidth=1.0 if dt else 1.8, linestyle="--" if hollow else "-",
                  markersize=4 if dt else 6, markerfacecolor="white" if hollow else color, alpha=0.75 if dt else 1.0,
                  zorder=2 if dt else 3)
    points = front([(row["cost_us_per_env_second"], height(row)) for row in rows])
    axes.plot(*zip(*points), linestyle="none", marker="o", markersize=12, markerfacecolor="none",
              markeredgecolor=INK, markeredgewidth=0.9, zorder=4)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(True, which="major", color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.set_xlabel("CPU time per environment and simulated second, one thread (\u00b5s)")
    if zeros:
        axes.axhline(floor, color=FAINT, linewidth=0.8, linestyle=":", zorder=1)
        axes.annotate("exactly 0", (1, floor), xycoords=("axes fraction", "data"), xytext=(0, 3),
                      textcoords="offset points", ha="right", fontsize=8, color=FAINT)
    return height


def step_name(dt):
    return f"1/{round(1 / dt)} s"


def label_steps(axes, rows, height):
    """The step sizes, once, beside the points of the best method there is."""
    for method in METHODS:
        members = [row for row in rows if row["method"] == method and row["precision"] == "f32"]
        if members:
            break
    least = min(row["iterations"] for row in members)
    for row in members:
        if row["iterations"] == least:
            axes.annotate(step_name(row["dt"]), (row["cost_us_per_env_second"], height(row)), xytext=(-9, -4),
                          textcoords="offset points", ha="right", va="top", fontsize=8, color=METHODS[method][0])


def label_sweeps(axes, rows, height):
    """The numbers of sweeps, along the largest step of each method that sweeps."""
    for method, offset in (("pgs", 7), ("tgs", 7)):
        members = [row for row in rows if row["method"] == method]
        if not members:
            continue
        largest = max(row["dt"] for row in members)
        for row in members:
            if row["dt"] == largest:
                axes.annotate(f"{row['iterations']:.0f}", (row["cost_us_per_env_second"], height(row)),
                              xytext=(0, offset), textcoords="offset points", ha="center", fontsize=7.5,
                              color=METHODS[method][0])


def legend(figure, rows):
    present = {row["method"] for row in rows}
    handles = [Line2D([], [], color=color, marker=marker, linewidth=1.8, label=method)
               for method, (color, marker) in METHODS.items() if method in present]
    if any(row["precision"] == "f64" for row in rows):
        handles.append(Line2D([], [], color=INK, marker="o", markerfacecolor="white", linestyle="--", label="f64"))
    handles.append(Line2D([], [], linestyle="none", marker="o", markersize=12, markerfacecolor="none",
                          markeredgecolor=INK, label="front: nothing is both cheaper and better"))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.06, 0.88), ncol=len(handles), frameon=False,
                  fontsize=9.5, handletextpad=0.5, columnspacing=1.6)


def failures(rows):
    """One phrase per method and number of sweeps: which steps failed."""
    groups = {}
    for row in rows:
        name = row["method"] + (f" {row['iterations']:.0f}" if row["iterations"] else "")
        groups.setdefault(name + (" f64" if row["precision"] == "f64" else ""), []).append(row)
    phrases = []
    for name, members in groups.items():
        steps = ", ".join(step_name(row["dt"])[:-2] for row in members)
        phrases.append(f"{name} at {steps}")
    return phrases


def main(table, picture, caption):
    caption = json.loads(caption)
    rows = read(table)
    failed = [row for row in rows if row["faulted"] or not row["rms_error"] <= caption["largest_error"]]
    good = [row for row in rows if row not in failed]
    coupled = caption["couplings"] > 0

    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 10, "svg.hashsalt": "lockstep",
                         "axes.edgecolor": FAINT, "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK})
    figure, panels = plt.subplots(1, 2 if coupled else 1, figsize=(13, 6.6) if coupled else (8.5, 6.6), squeeze=False)
    panels = panels[0]
    figure.subplots_adjust(left=0.07, right=0.98, top=0.76, bottom=0.17, wspace=0.18)
    figure.text(0.065, 0.945, f"{caption['model']}: error against cost", fontsize=16, fontweight="bold", color=INK)
    figure.text(0.065, 0.905, f"{caption['joints']} joints, {caption['couplings']} couplings, {caption['base']} base, "
                f"{caption['seconds']:g} s; {caption['cpu']}, {caption['target']}, "
                f"{caption['environments']} environments", fontsize=10, color="#555555")
    if good:
        height = draw_panel(panels[0], good, "rms_error")
        label_steps(panels[0], good, height)
        label_sweeps(panels[0], good, height)
        if coupled:
            height = draw_panel(panels[1], good, "coupling_error_max")
            label_sweeps(panels[1], good, height)
        legend(figure, good)
    panels[0].set_title(f"Error of the joint positions, RMS ({caption['unit']})", loc="left", fontsize=11, color=INK)
    if coupled:
        panels[1].set_title(f"Largest coupling error |C| ({caption['unit']})", loc="left", fontsize=11, color=INK)

    notes = [f"Numbers beside points: sweeps. Errors are against a run of {caption['truth_steps_per_second']:,} steps/s "
             f"in f64, extrapolated, itself within about {caption['truth_error']:.0e} {caption['unit']}."]
    if failed:
        notes.append("Failed (faulted or off by more than %g): " % caption["largest_error"] + "; ".join(failures(failed)))
    text = "\n".join(textwrap.fill(note, 190 if coupled else 120) for note in notes)
    figure.text(0.065, 0.02, text, fontsize=8.5, color="#555555", va="bottom")
    figure.savefig(picture, metadata={"Date": None} if picture.endswith(".svg") else None, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
