# Writes docs/results/accuracy.md, ranks.md, soak.md and stability.md. SPDX-License-Identifier: Apache-2.0
"""python3 result_pages.py [--machine MACHINE] [--docs FOLDER] [--check]

Reads accuracy.csv, precision.csv and stability_map/*.csv of bench/results/MACHINE, and soak.json and ranks.json of
bench/results. With --check it writes nothing, and fails if a page differs from what the files say. It needs the standard library only."""
import argparse
import csv
import sys
import textwrap
from pathlib import Path

from accuracy_points import cost, good, read
from ranks_page import ranks_page
from soak_page import soak_page

BENCH = Path(__file__).resolve().parent
WRITTEN = "This page is written by `python3 bench/result_pages.py` from {}. Do not edit it."


def markdown(head, rows):
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join("---" for _ in head) + " |"]
    return lines + ["| " + " | ".join(row) + " |" for row in rows] + [""]


def words(*paragraphs):
    """Wrapped lines of the paragraphs. Those that begin with a dash are a list."""
    lines = []
    for text in paragraphs:
        item = text.startswith("- ")
        lines += textwrap.wrap(text, 120, subsequent_indent="  " if item else "", break_long_words=False,
                               break_on_hyphens=False) + ([] if item else [""])
    return lines if lines[-1] == "" else lines + [""]


def machine(folder):
    return f"{folder.name} ({folder.joinpath('machine.txt').read_text().strip()}), a shared virtual machine"


def link(path, name):
    return f"[{name}](../../{path.relative_to(BENCH.parent)})"


# --- accuracy

SCENES = {
    "chain8": "an arm of 8 joints that falls in gravity, damped, 4 couplings",
    "gripper13": "an arm and a gripper, 13 joints, 5 couplings, stiff servos that follow moving targets",
    "chain32": "a floating whip of 32 joints, 16 couplings, 908 J",
    "hsrb": "Toyota HSR-B, 26 joints, 7 couplings",
    "Lhand": "Inspire hand, 12 joints",
    "romeo": "Romeo, 55 joints, 22 couplings; bodies of at least 0.01 kg and 1e-5 kg m²",
}


def setting(row):
    return f"{row['settings']}, 1/{row['steps_per_second']:.0f} s"


def is_own(row):
    return row["engine"] == "lockstep"


def cheapest(rows):
    """For each error, the cheapest setting of lockstep and the cheapest of the other engines that reach it."""
    lines = []
    for power in range(-2, -9, -1):
        reach = [row for row in rows if good(row, "rms") and row["rms"] <= 10.0 ** power]
        own = min(filter(is_own, reach), key=cost, default=None)
        other = min((row for row in reach if not is_own(row)), key=cost, default=None)
        if own:
            others = ["none", "", ""] if not other else [
                f"{other['engine']}, {setting(other)}", f"{cost(other):.3g}", f"{cost(other) / cost(own):.0f}"]
            lines.append([f"1e{power}", setting(own), f"{cost(own):.3g}"] + others)
    return markdown(["error", "cheapest of lockstep", "µs", "cheapest of the others", "µs", "ratio"], lines)


def cell(row, column, spec):
    return format(row[column], spec) if good(row, "rms") and row[column] == row[column] else ""


def at_all_steps(rows):
    """RMS error of each setting at each step size."""
    rates = sorted({row["steps_per_second"] for row in rows})
    lines = {}
    for row in rows:
        line = lines.setdefault((row["engine"], row["settings"]), {})
        error = f"{row['rms']:.1e}" if good(row, "rms") else "lost"
        line[row["steps_per_second"]] = f"{error}, {cost(row):.3g}"
    return markdown(["engine", "settings"] + [f"1/{rate:.0f} s" for rate in rates],
                    [[*key] + [line.get(rate, "") for rate in rates] for key, line in lines.items()])


def at_240(rows):
    lines = []
    for row in rows:
        if row["steps_per_second"] == 240:
            lines.append([row["engine"], row["settings"], cell(row, "rms", ".1e") or "lost",
                          cell(row, "largest_c", ".1e"), cell(row, "energy_error", ".1e"),
                          cell(row, "momentum_change", ".2g"), f"{cost(row):.3g}"])
    return markdown(["engine", "settings", "RMS error", "largest \\|C\\|", "energy error", "momentum", "µs"], lines)


def energies(rows):
    """Energy error and change of momentum of lockstep at each step size."""
    own = [row for row in rows if is_own(row)]
    rates = sorted({row["steps_per_second"] for row in own})
    lines = {}
    for row in own:
        cells = f"{row['energy_error']:.1e}, {row['momentum_change']:.2g}" if good(row, "rms") else "lost"
        lines.setdefault(row["settings"], {})[row["steps_per_second"]] = cells
    return markdown(["settings"] + [f"1/{rate:.0f} s" for rate in rates],
                    [[key] + [line.get(rate, "") for rate in rates] for key, line in lines.items()])


def precision(rows):
    lines = ["## Single precision against double", ""] + words(
        "RMS difference between `Batch<float>` and `Batch<double>`, rad, over all joints and the last second. Damped "
        "chains that fall, every second pair of joints coupled, at 1/240 s:")
    chains, scenes = {}, {}
    for row in rows:
        value = "diverges" if row["rms"] == "inf" else row["rms"]
        if row["model"] == "chain":
            chains.setdefault(row["joints"], {})[row["integrator"], row["seconds"]] = value
        else:
            scenes.setdefault((row["model"], row["integrator"]), {})[row["steps_per_second"]] = value
    columns = [(i, s) for i in ("leapfrog", "euler") for s in ("1", "5", "25")]
    lines += markdown(["joints"] + [f"{i}, {s} s" for i, s in columns],
                      [[joints] + [line[c] for c in columns] for joints, line in chains.items()])
    lines += ["The scenes over their first second:", ""]
    rates = sorted({rate for line in scenes.values() for rate in line}, key=int)
    return lines + markdown(["scene", "integrator"] + [f"1/{rate} s" for rate in rates],
                            [[*key] + [line[rate] for rate in rates] for key, line in scenes.items()])


def accuracy_page(folder):
    rows = read(folder / "accuracy.csv")
    with open(folder / "precision.csv", newline="") as file:
        precisions = list(csv.DictReader(file))
    sources = link(folder / "accuracy.csv", "accuracy.csv") + " and " + link(folder / "precision.csv", "precision.csv")
    peaks = sorted(row["peak_gflops"] for row in rows)
    lines = ["# Results: error against cost", ""] + words(
        WRITTEN.format(sources),
        f"[accuracy](../accuracy.md) says what the figures mean and shows them as charts. Machine: {machine(folder)}. "
        f"One thread, AVX2, peak {peaks[0]:.0f} to {peaks[-1]:.0f} Gflop/s, lockstep by the engine `tables`.",
        "- RMS error: over all joints and 240 instants of the first second, rad, against the exact motion.",
        "- \\|C\\|: largest coupling error in that second, rad.",
        "- Energy error: at its end, as a share of the scene's energy. Momentum: largest change of a component, N s or "
        "N m s. Only for engines that tell their velocities.",
        "- µs: CPU time per environment and simulated second, median of five.",
        "- lost: the run diverged, or is off by more than 1 rad.")
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == scene]
        robot = "" if any(row["engine"].startswith("Simbody") for row in own) else \
            " From a URDF file that is not part of this project, limits and friction left out."
        lines += [f"## {scene}", ""] + words(f"{scene}: {SCENES.get(scene, 'a robot')}.{robot}") + [
                  "The cheapest setting that reaches an error, and how many times as long the cheapest other engine "
                  "takes:", ""] + cheapest(own)
        lines += ["At 1/240 s:", ""] + at_240(own) + ["RMS error and µs at each step size:", ""] + at_all_steps(own)
        if scene == "chain32":
            lines += ["Energy error and change of momentum of lockstep at each step size:", ""] + energies(own)
    return "\n".join(lines + precision(precisions))


# --- stability

METHODS = ["pgs", "tgs", "direct", "reduced"]
LETTERS = {"holds": ".", "loose": "-", "open": "o", "damped": "-", "off": "o", "energy": "E", "fault": "#"}
MAPS = {
    "followers_sweeps": ("Stars", "followers of one leader", "sweeps"),
    "chain_sweeps": ("Chains", "couplings in a row", "sweeps"),
    "gear_sweeps": ("Gear ratios", "gear ratio", "sweeps"),
    "mass_dt": ("Masses against the step", "mass of the last four links, by that of the first four", "step (s)"),
    "mass_gear": ("Masses against gear ratios", "mass of the last four links, by that of the first four", "gear ratio"),
    "damping_dt": ("Damping", "damping of each joint (N m s/rad)", "step (s)"),
    "stiffness_dt": ("Stiff servos", "stiffness of the servo (N m/rad)", "step (s)"),
    "error_dt": ("Inconsistent starts", "coupling error at the start (rad)", "step (s)"),
    "frequency_dt": ("Soft couplings against the step", "stated frequency (Hz)", "step (s)"),
    "frequency_damping": ("Soft couplings against damping", "stated frequency (Hz)", "stated damping ratio"),
}


def number(name, value):
    if name == "dt":
        return f"1/{1 / value:.0f}"
    return f"{value:.0f}" if value == int(value) and value < 1000 else f"{value:.3g}"


class Map:
    def __init__(self, path):
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
        self.name = path.stem
        self.x, self.y = list(rows[0])[:2]
        self.found = {(row["method"], float(row[self.x]), float(row[self.y])): row for row in rows}
        self.xs = sorted({x for _, x, _ in self.found} - {0.0})  # 0 sweeps: the method does not sweep
        self.ys = sorted({y for _, _, y in self.found})

    def row(self, method, x, y):
        return self.found.get((method, x, y)) or self.found[method, 0.0, y]

    def picture(self):
        """A letter for each point: y downwards, x to the right, the methods side by side."""
        width, names = len(self.xs), [number(self.y, y) for y in self.ys]
        left = max(map(len, names))
        yield " " * left + "  " + "  ".join(f"{method:{width}}" for method in METHODS).rstrip()
        for y, name in zip(self.ys, names):
            yield f"{name:>{left}}  " + "  ".join(
                "".join(LETTERS[self.row(method, x, y)["class"]] for x in self.xs) for method in METHODS)

    def counts(self):
        kinds = [kind for kind in LETTERS if any(row["class"] == kind for row in self.found.values())]
        lines = []
        for method in METHODS:
            classes = [self.row(method, x, y)["class"] for x in self.xs for y in self.ys]
            errors = [float(self.row(method, x, y)["error"]) for x in self.xs for y in self.ys
                      if self.row(method, x, y)["class"] not in ("energy", "fault")]
            lines.append([method] + [str(classes.count(kind)) for kind in kinds] + [f"{max(errors):.2g}"])
        return markdown(["method"] + kinds + ["largest error"], lines)

    def sweeps_needed(self):
        """The number of sweeps from which on all larger numbers have a class that is at least as good."""
        def needed(method, y, classes):
            least = None
            for x in reversed(self.xs):
                if self.row(method, x, y)["class"] not in classes:
                    break
                least = x
            return "never" if least is None else f"{least:.0f}"

        def line(y):
            return [number(self.y, y)] + [needed(method, y, classes) for classes in (("holds",), ("holds", "loose"))
                                          for method in ("pgs", "tgs")] \
                + [self.row(m, 0.0, y)["error"] for m in METHODS[2:]]
        return markdown([self.y.replace("_", " "), "pgs holds from", "tgs holds from", "pgs below 1e-2 from",
                         "tgs below 1e-2 from", "error of direct", "of reduced"], [line(y) for y in self.ys])

    def errors_by_sweeps(self):
        """Errors of pgs and tgs for some y."""
        xs = [x for x in (1.0, 4.0, 16.0, 64.0, 256.0) if x in self.xs]
        ys = [y for i, y in enumerate(self.ys) if i % 4 == 3]
        return markdown([self.y.replace("_", " "), "method"] + [f"{x:.0f} sweep{'s' if x > 1 else ''}" for x in xs],
                        [[number(self.y, y), method] + [self.row(method, x, y)["error"] for x in xs]
                         for y in ys for method in ("pgs", "tgs")])

    def longest_steps(self):
        """The longest step for which it and all shorter steps have the class holds."""
        def longest(method, y):
            last = None
            for x in self.xs:
                if self.row(method, x, y)["class"] != "holds":
                    break
                last = x
            return "none" if last is None else number("dt", last)
        return markdown([MAPS[self.name][1]] + METHODS,
                        [[number(self.y, y)] + [longest(m, y) for m in METHODS] for y in self.ys])

    def lines(self):
        title, down, right = MAPS[self.name]
        ends = f"{number(self.x, self.xs[0])} to {number(self.x, self.xs[-1])}"
        yield from [f"## {title}", "", f"Downwards: {down}. To the right: {right}, {ends}.", "", "```"]
        yield from self.picture()
        yield from ["```", ""] + self.counts()
        if self.x == "sweeps":
            yield from ["Sweeps that it takes, up to 512:", ""] + self.sweeps_needed()
            yield from ["Errors (rad):", ""] + self.errors_by_sweeps()
        if self.x == "dt":
            words = "is as stated" if self.y == "frequency" else "holds"
            yield from [f"The longest step up to which the method {words} at every step, s:", ""] + self.longest_steps()


def stability_page(folder):
    maps = folder / "stability_map"
    lines = ["# Results: maps of stability", ""] + words(
        WRITTEN.format(link(maps, "the tables of the maps")),
        f"[stability](../stability.md) says what was run and shows the same as pictures. Machine: {machine(folder)}. "
        "Kernels `avx2`, `Batch<float>`, one thread.",
        "`.` holds, `-` loose, `o` open, `E` gains energy, `#` frozen by a fault. In the two maps of soft couplings "
        "`.` is as stated, `-` more damped, `o` neither. Largest errors are those of runs that neither gain energy nor "
        "fault: rad, for soft couplings a share of the error at the start.")
    for name in MAPS:
        lines += Map(maps / f"{name}.csv").lines()
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machine", default="xeon-sapphire-rapids", help="folder of bench/results")
    parser.add_argument("--docs", type=Path, default=BENCH.parent / "docs" / "results")
    parser.add_argument("--check", action="store_true", help="only compare")
    choices = parser.parse_args()
    folder, stale = BENCH / "results" / choices.machine, []
    soak = soak_page(BENCH / "results" / "soak.json", WRITTEN, words, markdown, link)
    ranks = ranks_page(BENCH / "results" / "ranks.json", WRITTEN, words, markdown, link)
    for name, page in (("accuracy.md", accuracy_page(folder)), ("ranks.md", ranks), ("soak.md", soak),
                       ("stability.md", stability_page(folder))):
        path, text = choices.docs / name, page.rstrip("\n") + "\n"
        if choices.check:
            if not path.exists() or path.read_text() != text:
                stale.append(str(path))
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        print(path)
    if stale:
        sys.exit(", ".join(stale) + ": differs from what the files say; run python3 bench/result_pages.py")


if __name__ == "__main__":
    main()
