# Draws the table of `lockstep chart`: error against cost. SPDX-License-Identifier: Apache-2.0
"""python3 chart.py TABLE.csv PICTURE.svg CAPTION, where CAPTION is JSON with the keys used below.

The command contains this script and runs it. The file is for drawing a table again."""
import csv
import json
import math
import sys
import textwrap

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.patheffects import withStroke  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter  # noqa: E402
from matplotlib.transforms import Bbox  # noqa: E402

# Okabe and Ito's palette, which colour-blind readers can tell apart; the markers differ too. The first method is drawn
# on top. Each integrator beyond Euler has its own line.
METHODS = {
    "leapfrog": ("#E69F00", "v"),
    "extrapolated": ("#56B4E9", "P"),
    "runge_kutta": ("#222222", "X"),
    "reduced": ("#0072B2", "o"),
    "direct": ("#D55E00", "s"),
    "pgs": ("#CC79A7", "^"),
    "tgs": ("#009E73", "D"),
}
LABELS = {"runge_kutta": "Runge-Kutta 4", "reduced": "reduced (Euler)", "direct": "direct (Euler)"}
INK, GREY = "#222222", "#5c5c5c"
# A point is on the front only if its error is smaller by this share.
NOTICEABLE = 0.02
COST = "cost_us_per_env_second"
# Where a label stands beside its point: offset in typographic points, alignment.
PLACES = {
    "above": ((0, 7), "center", "bottom"),
    "below": ((0, -7), "center", "top"),
    "left": ((-7, 0), "right", "center"),
    "right": ((7, 0), "left", "center"),
    "below left": ((-8, -3), "right", "top"),
    "above right": ((5, 4), "left", "bottom"),
}


def read(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for key in set(row) - {"method", "integrator", "precision"}:
            row[key] = float(row[key])
        if row["integrator"] != "euler":  # these have only one method, and the integrator names the line
            row["method"] = row["integrator"]
    return rows


def families(rows):
    """The points of each line. A method that sweeps has a line over the sweeps for each step size. Another method has
    one line over the step sizes."""
    groups = {}
    for row in rows:
        step = row["dt"] if row["iterations"] > 0 else None
        groups.setdefault((row["method"], row["precision"], step), []).append(row)
    for members in groups.values():
        members.sort(key=lambda row: (row["iterations"], -row["dt"]))
    return groups


def front(points):
    """The points that no other beats in both cost and error, from the cheapest on."""
    best, result = math.inf, []
    for cost, error in sorted(points):
        if error < best * (1 - NOTICEABLE):
            best = error
            result.append((cost, error))
    return result


def tidy_log_axis(axis, decades):
    """Labels the axis. An axis of few decades has labels at 2 and 5 too."""
    def plain(value, _):
        if value >= 0.01:
            return f"{value:,.10g}"
        power = math.floor(math.log10(value) + 1e-9)
        lead = round(value / 10.0 ** power)
        return f"$10^{{{power}}}$" if lead == 1 else f"${lead}\\cdot 10^{{{power}}}$"

    if decades < 2.7:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(plain))
    axis.set_minor_formatter(NullFormatter())


class Panel:
    """One quantity against cost."""

    def __init__(self, axes, rows, column):
        self.axes, self.rows, self.column = axes, rows, column
        positive = [row[column] for row in rows if row[column] > 0]
        lowest = min(positive, default=1e-16)
        # The height at which exact zeros are shown on a logarithmic axis: well below all other points.
        self.zero = 10.0 ** (math.floor(math.log10(lowest)) - 1.5)
        self.taken = []
        self.draw_lines()
        self.draw_front()
        self.dress()

    def at(self, row):
        return row[COST], row[self.column] if row[self.column] > 0 else self.zero

    def draw_lines(self):
        for (method, precision, step), members in families(self.rows).items():
            color, marker = METHODS[method]
            double = precision == "f64"
            order = 10 - list(METHODS).index(method) - (0.5 if double else 0)
            self.axes.plot(*zip(*map(self.at, members)), color=color, marker=marker,
                           markersize=4.5 if step else 6.5, markerfacecolor="white" if double else color,
                           linewidth=1.0 if step else 1.9, linestyle="--" if double else "-", zorder=order)

    def draw_front(self):
        self.axes.plot(*zip(*front(map(self.at, self.rows))), linestyle="none", marker="o", markersize=12.5,
                       markerfacecolor="none", markeredgecolor=INK, markeredgewidth=1.0, zorder=12)

    def shade_below(self, height, text):
        """Shades the area below a height, if enough of it is visible."""
        (left, right), (low, high) = self.axes.get_xlim(), self.axes.get_ylim()
        if math.log(height / low) > 0.06 * math.log(high / low):
            self.axes.axhspan(low, height, color="#eeeeee", zorder=0)
            self.write(text, (right, height), ("below left",), GREY)

    def dress(self):
        axes = self.axes
        axes.set_xscale("log")
        axes.set_yscale("log")
        costs, heights = zip(*map(self.at, self.rows))
        axes.set_xlim(min(costs) / 1.9, max(costs) * 1.35)
        span = math.log10(max(heights) / min(heights)) if max(heights) > min(heights) else 0.0
        margin = 10.0 ** max(0.07 * span, 0.12, 0.5 - span / 2)
        axes.set_ylim(min(heights) / margin, max(heights) * margin)
        tidy_log_axis(axes.xaxis, math.log10(max(costs) / min(costs)) + 0.4)
        tidy_log_axis(axes.yaxis, span + 0.25)
        axes.grid(True, which="major", color="#e6e6e6", linewidth=0.7)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        axes.set_xlabel("CPU time per environment and simulated second, one thread (\u00b5s)")
        if self.zero in heights:
            axes.axhline(self.zero, color=GREY, linewidth=0.8, linestyle=":", zorder=1)
            self.write("exactly 0", (axes.get_xlim()[0], self.zero), ("above right",), GREY)

    def write(self, text, point, places, color):
        """Writes beside a point, at the first place where the text covers no other text and no marker. Writes nothing
        if there is no such place."""
        to_pixels = self.axes.transData.transform
        here = to_pixels(point)
        markers = [Bbox.from_bounds(x - 3, y - 3, 6, 6) for x, y in to_pixels([self.at(row) for row in self.rows])
                   if math.hypot(x - here[0], y - here[1]) > 1]
        for place in places:
            offset, across, along = PLACES[place]
            label = self.axes.annotate(text, point, xytext=offset, textcoords="offset points", ha=across, va=along,
                                       fontsize=8.5, color=color, zorder=13,
                                       path_effects=[withStroke(linewidth=2.2, foreground="white")])
            box = label.get_window_extent(self.axes.figure.canvas.get_renderer()).padded(1.5)
            if not any(box.overlaps(other) for other in self.taken + markers):
                self.taken.append(box)
                return
            label.remove()

    def label_steps(self):
        """Writes the step sizes beside the points of the first line that is over the step sizes."""
        over_steps = [members for key, members in families(self.rows).items() if key[2] is None]
        for row in over_steps[0] if over_steps else []:
            self.write(f"1/{1 / row['dt']:.0f} s", self.at(row), ("below left", "left", "below", "above"),
                       METHODS[row["method"]][0])

    def label_sweeps(self, flat):
        """Writes the numbers of sweeps: of pgs along its largest step, of tgs along its smallest, so that they do not
        overlap. `flat`: the sweeps change the cost more than the height."""
        places = {"pgs": ("above", "below") if flat else ("below left", "left", "below"),
                  "tgs": ("below", "above") if flat else ("above right", "right")}
        for method, pick in (("pgs", max), ("tgs", min)):
            swept = [row for row in self.rows if row["method"] == method]
            for row in swept:
                if row["dt"] == pick(other["dt"] for other in swept):
                    self.write(f"{row['iterations']:.0f}", self.at(row), places[method], METHODS[method][0])


def legend(figure, rows, left, top, columns):
    present = {row["method"] for row in rows}
    handles = [Line2D([], [], color=color, marker=marker, linewidth=1.9, label=LABELS.get(method, method))
               for method, (color, marker) in METHODS.items() if method in present]
    if any(row["precision"] == "f64" for row in rows):
        handles.append(Line2D([], [], color=INK, marker="o", markerfacecolor="white", linestyle="--", label="in f64"))
    handles.append(Line2D([], [], linestyle="none", marker="o", markersize=12.5, markerfacecolor="none",
                          markeredgecolor=INK, label="front: no other is cheaper and better"))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(left, top), ncol=columns, frameon=False,
                  fontsize=9.5, handletextpad=0.6, columnspacing=1.5, labelspacing=0.35, borderaxespad=0, borderpad=0)


def failures(rows):
    """The step sizes at which each method and number of sweeps failed, in words."""
    groups = {}
    for row in rows:
        sweeps = f" {row['iterations']:.0f}" if row["iterations"] else ""
        name = row["method"] + sweeps + (" f64" if row["precision"] == "f64" else "")
        groups.setdefault(name, []).append(f"1/{1 / row['dt']:.0f}")
    return "; ".join(f"{name} at {', '.join(steps)}" for name, steps in groups.items())


def main(table, picture, caption):
    caption = json.loads(caption)
    rows = read(table)
    failed = [row for row in rows if row["faulted"] or not row["rms_error"] <= caption["largest_error"]]
    good = [row for row in rows if row not in failed]
    unit, coupled = caption["unit"], caption["couplings"] + caption["loops"] > 0

    swept = any(row["iterations"] for row in good)
    notes = [("Small numbers: sweeps, one line per step size. " if swept else "")
             + f"Error against a run of {caption['truth_steps_per_second']:,} steps/s in f64, extrapolated; "
             f"its own error is about {caption['truth_error']:.0e} {unit}."]
    if failed:
        notes.append(f"Failed (faulted or off by more than {caption['largest_error']:g}): {failures(failed)}.")
    notes = [line for note in notes for line in textwrap.wrap(note, 165 if coupled else 105)]

    width, height = (13.0 if coupled else 8.4), 6.4 + 0.17 * len(notes)
    left, right = 0.9 / width, 1 - 0.25 / width

    def down(inches):
        return 1 - inches / height

    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 10, "svg.hashsalt": "lockstep",
                         "axes.edgecolor": "#9a9a9a", "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK})
    figure, panels = plt.subplots(1, 2 if coupled else 1, figsize=(width, height), squeeze=False)
    figure.subplots_adjust(left=left, right=right, top=down(1.62), bottom=(0.75 + 0.17 * len(notes)) / height,
                           wspace=0.17)
    figure.text(left, down(0.42), f"{caption['model']}: error against cost", fontsize=17, fontweight="bold", color=INK)
    seconds = f"{caption['seconds']:g} s simulated"
    at_once = f", {caption['environments']} environments at once" if caption["environments"] else ""
    machine = f"{caption['cpu']} ({caption['target']}){at_once}"
    loops = f"{caption['loops']} loop{'s' * (caption['loops'] > 1)}, " if caption["loops"] else ""
    mechanism = f"{caption['joints']} joints, {caption['couplings']} couplings, {loops}{caption['base']} base"
    separator = "  \u00b7  " if coupled else "\n"
    figure.text(left, down(0.52), f"{mechanism}, {seconds}{separator}{machine}", fontsize=10, color=GREY, va="top")
    figure.text(left, 0.12 / height, "\n".join(notes), fontsize=8.8, color=GREY, va="bottom", linespacing=1.3)

    columns = [("rms_error", f"Error of the joint positions, RMS ({unit})")]
    if coupled:
        held = "error of couplings and loops |C| (rad, m)" if caption["loops"] else f"coupling error |C| ({unit})"
        columns.append(("coupling_error_max", f"Largest {held}"))
    for axes, (column, title) in zip(panels[0], columns):
        axes.set_title(title, loc="left", fontsize=11.5, color=INK, pad=9)
        if not good:
            axes.text(0.5, 0.5, "all runs failed", transform=axes.transAxes, ha="center", color=GREY)
            continue
        panel = Panel(axes, good, column)
        if column == "rms_error":
            panel.label_steps()
        panel.label_sweeps(flat=column == "rms_error")
        if column == "rms_error" and caption["truth_error"] > 0:
            panel.shade_below(caption["truth_error"], "below the error of the truth")
    if good:
        legend(figure, good, left, down(0.9), 6 if coupled else 4)
    figure.savefig(picture, metadata={"Date": None} if picture.endswith(".svg") else None, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
