# Draws what contacts cost and how well they hold. SPDX-License-Identifier: Apache-2.0
"""python3 bench/contacts/charts.py: from bench/contacts/results to docs/contacts

lockstep.jsonl has the lines of contacts_bench at several rates, mujoco-3.14.jsonl those of peer.mjs, sweeps.jsonl those
of sweeps.py, divergence.jsonl those of divergence_bench with all contact settings by euler and leapfrog, and
divergence-mujoco-3.14.jsonl those of divergence_peer.mjs."""
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
import numpy as np  # noqa: E402
from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.colors import BoundaryNorm, ListedColormap  # noqa: E402

HERE = pathlib.Path(__file__).parent
PICTURES = HERE.parents[1] / "docs" / "contacts"
INK, GREY, OWN, DOUBLE, OTHERS = "#222222", "#5c5c5c", "#d39200", "#a8430a", "#4f9ccb"
WASM = 1.33  # what a step costs in WebAssembly, of a native one: an estimate
plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9, "axes.edgecolor": "#9a9a9a", "axes.labelcolor": INK,
                     "axes.spines.top": False, "axes.spines.right": False, "svg.hashsalt": "lockstep"})


def lines(name):
    return [json.loads(line) for line in (HERE / "results" / name).read_text().splitlines()]


def save(figure, name):
    figure.savefig(PICTURES / name, metadata={"Date": None})
    plt.close(figure)


def front():
    """Error against cost: every rate of lockstep, every setting of MuJoCo that held the scene."""
    own, others = lines("lockstep.jsonl"), lines("mujoco-3.14.jsonl")
    panels = [("grasp 0.100", "grasp 0.1", "slip", "grasp of 100 g: slip (m)"),
              ("grasp 1.000", "grasp 1", "slip", "grasp of 1 kg: slip (m)"),
              ("quadruped trots", "trot", "penetration", "trot: how deep feet sink (m)"),
              ("slide", "slide", "deepest", "slide at 3 m/s: farthest from the floor (m)")]
    figure, all_axes = plt.subplots(1, 4, figsize=(13.5, 3.6))
    for axes, (name, theirs, key, title) in zip(all_axes, panels):
        for precision, color in (("f32", OWN), ("f64", DOUBLE)):
            points = sorted((p["hertz"] * p["ns_median"] * 1e-9, max(p.get(key) or 0.0, p.get("penetration", 0.0)
                                                                     if key == "deepest" else 0.0, p.get("highest", 0.0)
                                                                     if key == "deepest" else 0.0), p["hertz"])
                            for p in own if p["scene"] == name and p["precision"] == precision)
            if not points:
                continue
            cost, error, rate = zip(*points)
            axes.plot(cost, np.maximum(error, 1e-13), "o-", color=color, markersize=4, label=f"lockstep, {precision}")
            if precision == "f32":
                for x, y, hertz in points:
                    axes.annotate(f"{hertz}", (x, max(y, 1e-13)), textcoords="offset points", xytext=(3, 5), fontsize=7,
                                  color=GREY)
        held = [p for p in others if p["scene"] == theirs and p["held"] and p["error"]]
        axes.plot([p["cpu_per_s"] / WASM for p in held], [p["error"] for p in held], "s", color=OTHERS, markersize=4,
                  alpha=0.7, label="MuJoCo 3.14, settings that hold it")
        axes.set(xscale="log", yscale="log", xlabel="processor seconds a simulated second", title=title)
        axes.title.set_fontsize(9.5)
        axes.grid(color="#ececec")
    all_axes[0].legend(frameon=False, fontsize=8)
    figure.suptitle("Error against cost of one environment, one core (numbers: rate in Hz; lower left is better)", x=0.01,
                    ha="left", fontsize=11.5, fontweight="bold", color=INK)
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    save(figure, "front.svg")


def settings():
    """Contact settings: error against cost where environments differ, beside those of MuJoCo."""
    own, others = lines("divergence.jsonl"), lines("divergence-mujoco-3.14.jsonl")
    least = 1e-9  # smaller errors are drawn here
    figure, all_axes = plt.subplots(1, 3, figsize=(13.5, 3.9), sharey=True)
    for axes, scene in zip(all_axes, ("quadruped, feet", "quadruped, all pairs", "hand with cube")):
        for targets, face in ((0.5, None), (0.0, "white")):
            for integrator, color, marker in (("euler", OWN, "o"), ("leapfrog", DOUBLE, "^")):
                points = [p for p in own if p["scene"] == scene and p["targets"] == targets and
                          p["integrator"] == integrator and p["differ"] == (targets > 0)]
                axes.plot([p["us_median"] for p in points], [max(p["error_99"], least) for p in points], marker + "-",
                          color=color, markerfacecolor=face or color, markersize=5.5, linewidth=1 if targets else 0,
                          label=f"lockstep, {integrator}" if targets else None)
                for p in points if targets and integrator == "euler" else []:
                    axes.annotate(p["settings"], (p["us_median"], max(p["error_99"], least)), fontsize=7.5, color=GREY,
                                  textcoords="offset points", xytext=(5, 5))
            points = [p for p in others if p["scene"] == scene and p["targets"] == targets]
            axes.plot([p["us"] / WASM for p in points], [max(p["error99"], least) for p in points], "s", color=OTHERS,
                      markerfacecolor=face or OTHERS, markersize=5.5, label="MuJoCo 3.14" if targets else None)
        axes.set(xscale="log", yscale="log", xlabel="µs an environment-step", title=scene, ylim=(least / 2, 2))
        axes.grid(color="#ececec")
    all_axes[0].set_ylabel("error of 99 % of the steps")
    all_axes[0].legend(frameon=False, fontsize=8, loc="upper left")
    figure.suptitle("Contact settings: random targets within 0.5 rad that differ (filled), and at rest (hollow)", x=0.01,
                    ha="left", fontsize=11.5, fontweight="bold", color=INK)
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    save(figure, "settings.svg")


def heat(axes, rows, x, y, value, edges, colors, title, x_label):
    xs, ys = sorted({r[x] for r in rows}), sorted({r[y] for r in rows})
    grid = np.full((len(ys), len(xs)), np.nan)
    for r in rows:
        grid[ys.index(r[y]), xs.index(r[x])] = np.inf if r["fault"] else r[value]
    picture = axes.imshow(np.clip(grid, edges[0], edges[-1] * 0.999), origin="lower", aspect="auto",
                          cmap=ListedColormap(colors), norm=BoundaryNorm(edges, len(colors)))
    axes.set_xticks(range(len(xs)), [f"{float(f'{v:.2g}'):g}" for v in xs], fontsize=7, rotation=45)
    axes.set_yticks(range(len(ys)), [f"{v} Hz" for v in ys], fontsize=8)
    axes.set_xlabel(x_label)
    axes.set_title(title, fontsize=9.5)
    return picture


def maps():
    rows = lines("sweeps.jsonl")
    figure, all_axes = plt.subplots(1, 4, figsize=(14, 3.4))
    colors = ["#e4f0f8", "#bcdcf0", "#8cc6ea", "#f2cf7f", "#d39200", "#a8430a"]
    speeds, slips = [1e-18, 1e-8, 1e-5, 1e-3, 1e-1, 1, 1e9], [1e-9, 1e-5, 1e-4, 3e-4, 1e-3, 1e-2, 1e9]
    for axes, dtype in zip(all_axes, ("f4", "f8")):
        picture = heat(axes, [r for r in rows if r["sweep"] == "stack" and r["dtype"] == dtype], "mass", "rate", "speed",
                       speeds, colors, f"stack of three, {'single' if dtype == 'f4' else 'double'}: fastest at rest",
                       "mass on top, of the others")
    figure.colorbar(picture, ax=all_axes[1], label="m/s, rad/s", extend="max").ax.set_yticklabels(
        ["0", "1e-8", "1e-5", "1e-3", "0.1", "1", ""])
    for axes, key, label, title in zip(all_axes[2:], ("mass", "friction"), ("mass of the box (kg)", "friction"),
                                       ("arm and gripper, friction 0.9: slip", "arm and gripper, 0.2 kg: slip")):
        picture = heat(axes, [r for r in rows if r["sweep"] == "grasp" and key in r], key, "rate", "slip", slips, colors,
                       title, label)
    figure.colorbar(picture, ax=all_axes[3], label="m", extend="max").ax.set_yticklabels(
        ["0", "10 µm", "0.1 mm", "0.3 mm", "1 mm", "1 cm", ""])
    figure.tight_layout()
    save(figure, "maps.svg")


def costs():
    rows = lines("sweeps.jsonl")
    figure, all_axes = plt.subplots(1, 3, figsize=(11, 3.2))
    for axes, (sweep, key, label) in zip(all_axes, [("tower", "blocks", "blocks in a tower at rest (4 points each)"),
                                                    ("top", "mass", "mass on top of a stack of three, of the others"),
                                                    ("blows", "speed", "random speeds of three blocks (m/s, rad/s)")]):
        own = sorted((r for r in rows if r["sweep"] == sweep), key=lambda r: r[key])
        x = [r[key] for r in own]
        axes.fill_between(x, [r["least"] for r in own], [r["median"] for r in own], color=OWN, alpha=0.3)
        axes.plot(x, [r["median"] for r in own], "o-", color=OWN, markersize=4)
        axes.set(xlabel=label, ylabel="ns an environment-step", ylim=(0, None))
        if key != "blocks":
            axes.set_xscale("log")
        axes.grid(color="#ececec")
    figure.suptitle("Cost: median of stretches, and down to the least", x=0.01, ha="left", fontsize=11, fontweight="bold")
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    save(figure, "costs.svg")


if __name__ == "__main__":
    front()
    maps()
    costs()
    settings()
