# Draws the tables of measure.py. SPDX-License-Identifier: Apache-2.0
"""python3 charts.py FOLDER_OF_CSV FOLDER_OF_PICTURES"""
import re
import sys
from collections import defaultdict
from pathlib import Path

import matplotlib

from rows import SCENES, rates, read

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator, PercentFormatter  # noqa: E402

INK, GREY, LINE = "#222222", "#5c5c5c", "#d5d5d5"
OWN, OTHERS, FAILED = "#d39200", "#4f9ccb", "#c9c9c9"
SCENE_COLORS = {"chain8": "#1f6fa5", "gripper13": "#d39200", "chain32": "#a8430a"}
METHOD_COLORS = {"reduced": "#d39200", "direct": "#1f6fa5", "pgs": "#7a7a7a"}
STAGE_COLORS = {
    "kinematics": "#c7e0f0", "bias forces": "#8cc6ea", "mass matrix": "#4f9ccb", "elimination": "#f2cf7f",
    "free velocity": "#d39200", "responses": "#c9703c", "row terms": "#e8b48f", "rows solved": "#a8430a",
    "integration": "#8a8a8a", "others": "#d5d5d5",
}
# The rows of peers.csv that are drawn, in this order: the first word of the engine, and its settings.
ROWS = [
    ("lockstep", "reduced, f32, avx512, generated, 4 steps per call"),
    ("lockstep", "reduced, f32, avx2, generated, 4 steps per call"),
    ("lockstep", "reduced, f32, avx2, generated, 1 step per call"),
    ("lockstep", "reduced, f32, avx2, generated, 4 steps per call in 2 parts each"),
    ("lockstep", "leapfrog, f32, avx2, generated, 4 steps per call"),
    ("lockstep", "reduced, f32, avx2, 4 steps per call"),
    ("lockstep", "reduced, f32, avx2, 1 step per call"),
    ("lockstep", "reduced, f64, avx2, 1 step per call"),
    ("lockstep", "direct, f32, avx2, 4 steps per call"),
    ("lockstep", "pgs 4, f32, avx2, 4 steps per call"),
    ("MuJoCo", "default"), ("MuJoCo", "firm: Euler, Newton once, dense"),
    ("MuJoCo", "stiff: Euler, Newton once, dense"),
    ("MuJoCo", "stiff: RK4, Newton once, dense"),
    ("Bullet", "pgs 10, f64"), ("Bullet", "pgs 50, f64"),
    ("Simbody", "semi-explicit Euler, f64"), ("Simbody", "Runge-Kutta-Merson, 1e-3, f64"),
]

plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9.5, "axes.edgecolor": "#9a9a9a",
                     "axes.labelcolor": INK, "xtick.color": INK, "ytick.color": INK,
                     "axes.spines.top": False, "axes.spines.right": False})


def rate(value):
    for size, letter in ((1e6, " M"), (1e3, " k")):
        if value >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.0f}"


def heading(figure, title, words, left=0.02):
    height = figure.get_figheight()
    figure.text(left, 1 - 0.22 / height, title, fontsize=12.5, fontweight="bold", color=INK, va="top")
    figure.text(left, 1 - 0.50 / height, words, fontsize=9.5, color=GREY, va="top")


def save(figure, path):
    figure.savefig(path, dpi=120)
    plt.close(figure)


def sound(row):
    """True if the row simulates the scene: it did not diverge, and its error is small."""
    return row["diverged"] == "0" and float(row["rms"]) < 0.05


def lead(table, scene):
    """How many times as fast generated code for AVX2 is as the fastest other engine that does not diverge."""
    own = next(row for row in table if (row["scene"], row["settings"]) == (scene, ROWS[1][1]))
    return float(own["steps_per_second"]) / max(
        float(row["steps_per_second"]) for row in table
        if row["scene"] == scene and row["engine"] != "lockstep" and row["diverged"] == "0")


def draw_peers(table, picture):
    found = {(row["engine"].split()[0], row["settings"], row["scene"]): row for row in table}
    names = {row["engine"].split()[0]: row["engine"] for row in table}
    rows = [row for row in ROWS if row + (SCENES[0],) in found]
    figure, panels = plt.subplots(1, 3, figsize=(13.2, 1.5 + 0.31 * len(rows)), sharey=True)
    figure.subplots_adjust(left=0.245, right=0.99, top=1 - 1.12 / figure.get_figheight(), bottom=0.1, wspace=0.06)
    for panel, scene in zip(panels, SCENES):
        for place, key in enumerate(rows):
            row = found[key + (scene,)]
            speed, failed = float(row["steps_per_second"]), not sound(row)
            color = FAILED if failed else OWN if key[0] == "lockstep" else OTHERS
            panel.barh(place, speed, color=color, height=0.72)
            error = "diverges" if row["diverged"] == "1" else f"{float(row['rms']):.1e}".replace("e-0", "e-")
            panel.text(speed * 1.15, place, f"{rate(speed)}/s · {error}", va="center", fontsize=8.5,
                       color=GREY if failed else INK)
        panel.set_xscale("log")
        panel.set_xlim(20, 3e10)
        panel.xaxis.set_major_locator(FixedLocator([1e2, 1e4, 1e6]))
        panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: rate(value)))
        panel.xaxis.set_minor_locator(NullLocator())
        panel.tick_params(axis="y", length=0)
        panel.set_title(f"{scene}: {lead(table, scene):.0f} times the fastest other", loc="left", fontsize=10.5,
                        color=INK)
    labels = [f"{names[engine]}: {words}".replace("avx512, ", "AVX-512, ").replace("avx2, ", "AVX2, ")
              .replace(" per call", "/call").replace(" in 2 parts each", ", halved").replace("lockstep: ", "")
              for engine, words in rows]
    panels[0].set_yticks(range(len(rows)), labels, fontsize=8.5)
    panels[0].invert_yaxis()
    figure.supxlabel("environment-steps per second of one core", fontsize=9.5, color=INK, x=0.6, y=0.005)
    heading(figure, "Steps per second, and the joints' error in the first second (rad), at 1/240 s",
            "One core; all take turns in one run. Grey: diverges, or is off by more than 0.05 rad. The titles compare "
            "AVX2, generated, 4 steps/call with the fastest other engine that does not diverge.")
    save(figure, picture)


def grouped(stages):
    """Times of the stages by the names of STAGE_COLORS. Stages that have no colour are added up as others."""
    sums = defaultdict(float)
    for row in stages:
        sums[row["stage"] if row["stage"] in STAGE_COLORS else "others"] += max(0.0, float(row["ns_per_tile"]))
    return sums


def draw_stages(table, picture):
    figure, panels = plt.subplots(1, 3, figsize=(13.2, 3.3))
    figure.subplots_adjust(left=0.06, right=0.99, top=0.70, bottom=0.27, wspace=0.2)
    for panel, scene in zip(panels, SCENES):
        for place, method in enumerate(METHOD_COLORS):
            sums = grouped([row for row in table if (row["scene"], row["method"]) == (scene, method)
                            and row["stage"] != "step"])
            left, total = 0.0, sum(sums.values())
            for stage, color in STAGE_COLORS.items():
                width = sums[stage] / 8
                panel.barh(place, width, left=left, color=color, height=0.7, edgecolor="white", linewidth=0.4)
                if sums[stage] > 0.1 * total:
                    panel.text(left + width / 2, place, f"{sums[stage] / total:.0%}", ha="center", va="center",
                               fontsize=8.5, color=INK)
                left += width
        panel.set_yticks(range(len(METHOD_COLORS)), METHOD_COLORS)
        panel.tick_params(axis="y", length=0)
        panel.invert_yaxis()
        panel.set_title(scene, loc="left", fontsize=10.5, color=INK)
        panel.set_xlabel("ns per environment-step")
    handles = [plt.Rectangle((0, 0), 1, 1, color=color) for color in STAGE_COLORS.values()]
    figure.legend(handles, STAGE_COLORS, loc="lower left", bbox_to_anchor=(0.05, -0.01), ncol=len(STAGE_COLORS),
                  frameon=False, fontsize=9, handlelength=1.1, columnspacing=1.3)
    heading(figure, "Where the time of a step goes", "One core, f32, eight environments in a register, pgs with 4 "
            "sweeps. The time of a stage is what it adds to the stages before it.")
    save(figure, picture)


def line(panel, found, pattern, label, color, scale=lambda n: 1.0, **style):
    points = sorted((int(match[1]), value) for name, value in found.items()
                    if (match := re.fullmatch(pattern, name)))
    panel.plot([n for n, _ in points], [value * scale(n) for n, value in points], "o-", color=color, label=label,
               markersize=4, **style)


def draw_scaling(table, picture):
    rows = rates(table)
    found = {name: row.speed for name, row in rows.items()}
    figure, panels = plt.subplots(1, 4, figsize=(13.2, 3.9))
    figure.subplots_adjust(left=0.045, right=0.99, top=0.73, bottom=0.15, wspace=0.24)
    environments, dofs, couplings, threads = panels
    line(environments, found, r"step/chain8/reduced/1/f32/environments:(\d+)", "chain8", SCENE_COLORS["chain8"])
    environments.set_xscale("log", base=4)
    environments.set_xticks([64, 1024, 16384, 262144], ["64", "1024", "16384", "262144"])
    environments.set(title="Any number of environments", xlabel="environments", ylabel="million steps per second")
    line(dofs, found, r"step/chain/reduced/1/f32/coupled/dofs:(\d+)", "half of them coupled", METHOD_COLORS["reduced"])
    line(dofs, found, r"step/chain/reduced/1/f32/dofs:(\d+)", "free", METHOD_COLORS["direct"])
    dofs.set_xscale("log", base=2)
    dofs.set_yscale("log")
    dofs.set_xticks([1, 2, 4, 8, 16, 32, 64], [1, 2, 4, 8, 16, 32, 64])
    dofs.set(title="Longer chains", xlabel="joints")
    dofs.legend(frameon=False, fontsize=8.5)
    for method, color in METHOD_COLORS.items():
        line(couplings, found, rf"step/chain16/{method}/\d+/f32/couplings:(\d+)", method, color)
    couplings.set(title="More couplings, 16 joints", xlabel="couplings", ylim=(0, None))
    couplings.legend(frameon=False, fontsize=8.5, loc="lower left")
    for scene in SCENES:
        one = found[f"step/{scene}/reduced/1/f32/threads:1"]
        line(threads, found, rf"step/{scene}/reduced/1/f32/threads:(\d+)", scene, SCENE_COLORS[scene],
             lambda _, one=one: 1 / one)
    threads.plot([1, 2], [1, 2], ":", color=GREY, linewidth=1, label="as many times")
    if "peak/avx2_f32/real_time/threads:2" in rows:
        cores = rows["peak/avx2_f32/real_time/threads:2"].gflops / rows["peak/avx2_f32"].gflops
        threads.plot([1, 2], [1, cores], "--", color=INK, linewidth=1, label="multiply-adds")
    threads.set(title="Threads", xlabel="threads", ylabel="times one thread", xticks=[1, 2], ylim=(0, 2.5))
    threads.legend(frameon=False, fontsize=8.5, loc="upper left")
    environments.set_ylim(0, 1.2 * environments.get_ylim()[1])
    for panel in panels:
        panel.set_title(panel.get_title(), loc="left", fontsize=10.5, color=INK)
        panel.set_title("", loc="center")
        panel.grid(color=LINE, linewidth=0.5)
        panel.xaxis.set_minor_locator(NullLocator())
    heading(figure, "How the speed scales", "reduced unless a label says otherwise, f32, 4 steps per call. One core, "
            "CPU time and medians; for threads, wall time and the fastest repeat.")
    save(figure, picture)


def draw_peak(table, picture):
    stages = [stage for stage in list(STAGE_COLORS) if stage != "others"] + ["step"]
    stages = [stage for stage in stages if any(row["stage"] == stage for row in table)]
    figure, panel = plt.subplots(figsize=(8.6, 1.6 + 0.32 * len(stages)))
    figure.subplots_adjust(left=0.23, right=0.98, top=1 - 0.95 / figure.get_figheight(), bottom=0.13)
    for row in table:
        # With reduced, which is the default; stages that it does not have, with direct.
        method = "direct" if row["stage"] in ("responses", "row terms", "rows solved") else "reduced"
        if row["stage"] in stages and row["method"] == method:
            panel.plot(float(row["share_of_peak"]), stages.index(row["stage"]), "o", color=SCENE_COLORS[row["scene"]],
                       markersize=9 if row["stage"] == "step" else 6.5)
    panel.set_yticks(range(len(stages)), [{"step": "the whole step"}.get(s, s) for s in stages])
    panel.get_yticklabels()[-1].set_fontweight("bold")
    panel.invert_yaxis()
    panel.set_xlim(0, 1)
    panel.xaxis.set_major_formatter(PercentFormatter(1))
    panel.grid(color=LINE, linewidth=0.5)
    panel.set_axisbelow(True)
    for scene, color in SCENE_COLORS.items():
        panel.plot([], [], "o", color=color, label=scene)
    panel.legend(frameon=False, loc="center right")
    panel.set_xlabel("share of the fused multiply-adds that the core can do")
    peak = sorted(float(row["peak_gflops"]) for row in table)[len(table) // 2]
    heading(figure, "How near to the peak",
            f"The peak is {peak:.0f} Gflop/s of independent AVX2 multiply-adds, measured in the same run")
    save(figure, picture)


def draw_all(tables, pictures):
    Path(pictures).mkdir(parents=True, exist_ok=True)
    for name, source, draw in (("peers", "peers", draw_peers), ("stages", "stage_bench", draw_stages),
                               ("scaling", "step_bench", draw_scaling), ("peak", "stage_bench", draw_peak)):
        draw(read(Path(tables) / (source + ".csv")), Path(pictures) / (name + ".png"))


if __name__ == "__main__":
    draw_all(*sys.argv[1:])
