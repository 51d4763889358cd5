# Writes docs/results/performance.md from the CSV files of measure.py. SPDX-License-Identifier: Apache-2.0
"""Writes the tables of one machine's results as Markdown. With --check it writes nothing, and exits with 1 if the page
differs from what the CSV files say."""
import argparse
import re
import sys
import textwrap
from collections import defaultdict
from pathlib import Path

from rows import SCENES, rates, read

BENCH = Path(__file__).resolve().parent
MACHINE = "epyc-genoa"  # the machine whose figures the documents state
PAGE = BENCH.parent / "docs" / "results" / "performance.md"
NONE = "–"  # not measured

ENGINES = ["tables", "compiled", "generated"]
METHODS = [("reduced", 1), ("direct", 1), ("pgs", 1), ("pgs", 4), ("pgs", 16), ("tgs", 1), ("tgs", 4), ("tgs", 16)]
INTEGRATORS = ["leapfrog", "extrapolated", "runge_kutta"]
CHAINS = [4, 8, 16, 20, 24, 32, 64]
LADDER = [  # rows of the ladder, and what each adds
    ("direct", "bare", "nothing: no coupling, no damping"), ("direct", "damping", "joint damping"),
    ("direct", "drives", "a drive on every joint"), ("reduced", "hard-reduced", "four hard couplings, `reduced`"),
    ("reduced", "hard-reduced-impulses", "the same, impulses recorded"),
    ("reduced", "hard-reduced-gear_ratio-per-environment", "the same, `gear_ratio` per environment"),
    ("direct", "hard-direct", "four hard couplings, `direct`"),
] + [("direct", f"{field}-per-environment", f"the same, `{field}` per environment")
     for field in ("gear_ratio", "offset", "softness", "drive_gains", "damping", "mass", "gravity", "link_wrench",
                   "coupling_switch")] + [
    ("direct", "soft-spring", "four soft couplings, kp and kd"),
    ("direct", "soft-frequency", "four soft couplings, by frequency"),
    ("direct", "soft-frequency-damping", "the same with damping: a second factorisation"),
]
BOUNDS = [
    ("none", "none"), ("limits-inactive", "position ranges, never reached"),
    ("velocity-limits-inactive", "velocity limits, never reached"),
    ("efforts-inactive", "effort limits, never reached"),
    ("limits-active", "position ranges of ±0.35 rad"), ("friction", "dry friction of 0.1 N m"),
    ("efforts-active", "effort limits of 0.5 N m"), ("all-active", "all of these, and velocity limits of 2 rad/s"),
]
# Bounds that the motion of a scene never reaches.
NOT_REACHED = {("gripper13", "limits-active"), ("chain8", "efforts-active")}

# What the page says above the tables of a section.
WORDS = {
    "Engines":
        "Euler steps where no integrator is named. Half of the joints of a *chain of n* are coupled in pairs. The "
        "rows with an integrator are measured for `generated` only; [Integrators](#integrators) has the others.",
    "Size of generated code":
        "Operations of one step on registers; a multiply-add is one, and so is each operation of a sine's "
        "polynomial. *Consistent*: of the step for tiles whose followers are all consistent, where there is one. "
        "Code: one precision, AVX2.",
    "Consistent followers":
        "`reduced`. *Inconsistent*: every 40 steps all environments are reset to a state in which the followers are "
        "0.2 rad off.",
    "Methods and precisions":
        "Automatic engine, no generated code. In brackets: Gflop/s, counted as the operations that the tables take "
        "for this step (`Plan::flops_per_step()`).",
    "Integrators":
        "`reduced`, AVX2. `runge_kutta` refuses gripper13, which is too stiff for it.",
    "Other engines":
        "A cell: environment-steps per second of CPU time on one core; root mean square error of the joints over "
        "one second, rad; largest coupling error over five seconds, rad. Steps of 1/240 s. Speeds of lockstep are "
        "medians, those of others the fastest of the repeats. Rows of lockstep that do not say *generated*: "
        "automatic engine, no generated code.",
    "Stages":
        "Engine `tables`, f32, AVX2, one tile of 8 environments, inconsistent followers, `pgs` with 4 sweeps.",
    "Threads":
        "`reduced`, f32, 16,384 environments, wall time. Speeds are the fastest of the repeats, as anything else "
        "that runs on one of the two cores delays both.",
    "Environments":
        "chain8, `reduced`, f32, AVX2, by the number of environments.",
    "Steps per call":
        "`reduced`, f32, AVX2, automatic engine (then an interpreter).",
    "Joints and couplings":
        "f32, AVX2, automatic engine (then an interpreter). Chains by `reduced`:",
    "Features":
        "A chain of eight joints with one feature more at a time, f32, AVX2, automatic engine: then an "
        "interpreter, and the tables where all couplings are soft.",
    "Bounds":
        "f32, AVX2, automatic engine: then an interpreter, and the tables where there is friction or a servo with a "
        "limited effort. Every joint has the bound. In brackets: how many times the time of a step without bounds. "
        "Timed are the first hundred steps of the motion, again and again.",
    "Robots from files":
        "f32, AVX2, without their limits. Gflop/s are those of the automatic engine.",
    "Errors of Euler's step":
        "What the speeds above stand for: `reduced`, root mean square error of the joints over one second, and the "
        "largest coupling error, rad.",
}


class Results:
    """The CSV files of one machine."""

    def __init__(self, folder):
        self.folder = folder
        self.avx2 = rates(read(folder / "step_bench.csv"))
        self.avx512 = rates(read(folder / "step_bench_avx512.csv"))
        self.robots = rates(read(folder / "robots.csv"))
        self.kernels = {row["kernel"]: row for row in read(folder / "kernels.csv")}
        self.stages = read(folder / "stage_bench.csv")
        self.peers = read(folder / "peers.csv")
        self.engines = [engine for engine in ENGINES if any(f"/engine:{engine}" in name for name in self.avx2)]

    def targets(self):
        return [("AVX2", self.avx2)] + ([("AVX-512", self.avx512)] if self.avx512 else [])


def number(value):
    if value is None:
        return NONE
    return f"{value:.2f}" if value < 0.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def percent(share):
    return f"{share:.0%}".replace("%", " %")


def speed(found, name):
    return found[name].speed if name in found else None


def table(head, rows, labels=1, title=""):
    """A Markdown table. Rows begin with `labels` labels; rows without a figure are left out. Empty without rows."""
    rows = [row for row in rows if any(cell != NONE for cell in row[labels:])]
    if not rows:
        return ""
    lines = [head, ["---"] * len(head)] + rows
    text = "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines) + "\n\n"
    return f"{title}\n\n{text}" if title else text


def engine_words():
    """Engine, steps per call, and the words of both in the names of rows."""
    for engine in ["automatic"] + ENGINES:
        for substeps, words in ((4, ""), (1, "/substeps:1")):
            yield engine, substeps, words + ("" if engine == "automatic" else f"/engine:{engine}")


def section(title, *tables):
    """A section of the page; empty without tables."""
    text = "".join(tables)
    return f"## {title}\n\n{textwrap.fill(WORDS[title], 120, break_on_hyphens=False)}\n\n{text}" if text else ""


def method_words(method, iterations):
    return method if method in ("reduced", "direct") else f"{method} {iterations}"


def models():
    """What every engine steps: its words, the name of its row, and the name of its generated kernel."""
    for n in CHAINS:
        yield f"chain of {n}, `reduced`", f"step/chain/reduced/1/f32/coupled/dofs:{n}", f"chain{n}_coupled"
    for scene in SCENES:
        for method, iterations in (("reduced", 1), ("direct", 1), ("pgs", 4)):
            yield (f"{scene}, `{method_words(method, iterations)}`", f"step/{scene}/{method}/{iterations}/f32",
                   f"{scene}_{method}")
        for integrator in INTEGRATORS:
            yield (f"{scene}, `reduced`, `{integrator}`", f"step/{scene}/reduced/1/f32/integrator:{integrator}",
                   f"{scene}_{integrator}")


def engines(results):
    targets = results.targets()
    head = ["model"] + [f"{isa}, {engine}" for isa, _ in targets for engine in results.engines]
    tables = []
    for words, substeps in (("4 steps per call:", ""), ("1 step per call:", "/substeps:1")):
        rows = [[model] + [number(speed(found, f"{name}{substeps}/engine:{engine}")) for _, found in targets
                           for engine in results.engines] for model, name, _ in models()]
        tables.append(table(head, rows, title=words))
    return section("Engines", *tables)


def generated(results):
    rows = []
    for model, _, kernel in models():
        row = results.kernels.get(kernel)
        if row:
            rows.append([model, row["operations"], row["consistent_operations"] or NONE, row["code_kb"]])
    rows.sort(key=lambda row: int(row[1]))
    return section("Size of generated code", table(["model", "operations", "consistent", "code (kB)"], rows))


def consistent(results):
    targets = results.targets()
    rows = [[scene, engine] + [number(speed(found, f"step/{scene}/reduced/1/f32{words}/engine:{engine}"))
                               for _, found in targets for words in ("/inconsistent", "")]
            for scene in SCENES for engine in ENGINES]
    head = ["scene", "engine"] + [f"{isa}, {words}" for isa, _ in targets for words in ("inconsistent", "consistent")]
    return section("Consistent followers", table(head, rows, 2))


def methods(results):
    names = [method_words(m, k) for m, k in METHODS]
    tables = []
    for isa, found in results.targets():
        rows = []
        for scene in SCENES:
            for precision in ("f32", "f64"):
                cells = [found.get(f"step/{scene}/{m}/{k}/{precision}") for m, k in METHODS]
                rows.append([scene, precision] + [f"{number(c.speed)} ({c.gflops:.0f})" if c else NONE for c in cells])
        tables.append(table(["scene", "precision"] + names, rows, 2, f"{isa}:"))
    rows = []
    for isa, found in results.targets():
        for scene in SCENES:
            pairs = [[speed(found, f"step/{scene}/{m}/{k}/{p}") for p in ("f64", "f32")] for m, k in METHODS]
            rows.append([isa, scene] + [f"{f64 / f32:.2f}" if f64 and f32 else NONE for f64, f32 in pairs])
    return section("Methods and precisions", *tables,
                   table(["target", "scene"] + names, rows, 2, "Speed of f64 divided by that of f32:"))


def integrators(results):
    rows = []
    for scene in SCENES:
        for words, precision, engine in (("automatic", "f32", ""), ("automatic", "f64", ""),
                                         ("generated", "f32", "/engine:generated")):
            name = f"step/{scene}/reduced/1/{precision}"
            cells = [speed(results.avx2, f"{name}{'' if i == 'euler' else '/integrator:' + i}{engine}")
                     for i in ["euler"] + INTEGRATORS]
            rows.append([scene, words, precision] + [number(cell) for cell in cells])
    return section("Integrators", table(["scene", "engine", "precision", "euler"] + INTEGRATORS, rows, 3))


def short(value):
    return re.sub(r"e([+-])0", r"e\1", f"{value:.1e}") if 0 < abs(value) < 0.1 else f"{value:.2g}"


def rate(value):
    for size, letter in ((1e6, " M"), (1e3, " k")):
        if value >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.0f}"


def peer_cell(row):
    if row is None:
        return NONE
    errors = f"{short(float(row['rms']))}; {short(float(row['largest_c']))}"
    return f"{rate(float(row['steps_per_second']))}; {'diverges' if row['diverged'] == '1' else errors}"


def peers(results):
    found, fastest = defaultdict(dict), defaultdict(float)
    for row in results.peers:
        settings = row["settings"].replace("avx512", "AVX-512").replace("avx2", "AVX2")
        found[row["engine"], settings][row["scene"]] = row
        if row["engine"] != "lockstep" and row["diverged"] == "0":
            fastest[row["scene"]] = max(fastest[row["scene"]], float(row["steps_per_second"]))

    def times(row):
        best = fastest[row["scene"]] if row else 0
        return f"{float(row['steps_per_second']) / best:.0f}" if best else NONE

    errors = [[engine, settings] + [peer_cell(rows.get(scene)) for scene in SCENES]
              for (engine, settings), rows in found.items()]
    leads = [[settings] + [times(rows.get(scene)) for scene in SCENES]
             for (engine, settings), rows in found.items() if engine == "lockstep"]
    return section(
        "Other engines", table(["engine", "settings"] + SCENES, errors, 2),
        table(["lockstep's settings"] + SCENES, leads,
              title="How many times as fast as the fastest other engine that does not diverge, whatever its error:"))


def stages(results):
    found = defaultdict(dict)
    for row in results.stages:
        found[row["scene"], row["method"]][row["stage"]] = row
    names = [name for name in max(found.values(), key=len, default=[]) if name != "step"]  # that of all stages
    rows, shares = [], []
    for (scene, method), stage in found.items():
        step = float(stage["step"]["ns_per_tile"])
        rows.append([scene, method, f"{step:.0f}"]
                    + [percent(float(stage[n]["ns_per_tile"]) / step) if n in stage else NONE for n in names])
        shares.append([scene, method] + [percent(float(stage[n]["share_of_peak"]))
                                         if n in stage and int(stage[n]["flops"]) else NONE for n in ["step"] + names])
    return section(
        "Stages",
        table(["scene", "method", "step (ns)"] + names, rows, 2, "Time of a step, and the stages' shares of it:"),
        table(["scene", "method", "step"] + names, shares, 2, "Share of the core's multiply-add peak:"))


def threads(results):
    rows = []
    for isa, found in results.targets():
        for scene in SCENES:
            for engine, substeps, words in engine_words():
                one, two = (found.get(f"step/{scene}/reduced/1/f32/threads:{n}{words}") for n in (1, 2))
                if one and two:
                    rows.append([isa, scene, engine, substeps, number(one.speed), number(two.speed),
                                 f"{two.speed / one.speed:.2f}", f"{two.median / one.median:.2f}"])
        one, two = found.get("peak/avx2_f32"), found.get("peak/avx2_f32/real_time/threads:2")
        if one and two:
            rows.append([isa, "multiply-adds alone"] + [NONE] * 4 + [f"{two.gflops / one.gflops:.2f}", NONE])
    head = ["target", "scene", "engine", "steps per call", "1 thread", "2 threads", "times", "times, medians"]
    return section("Threads", table(head, rows, 2))


def sizes(found, word):
    return sorted({int(match[1]) for name in found if (match := re.search(rf"/{word}:(\d+)", name))})


def scaling(results):
    def cells(prefix, numbers, words=""):
        return [number(speed(results.avx2, f"step/{prefix}:{n}{words}")) for n in numbers]

    counts, lengths, couplings, calls = (sizes(results.avx2, word)
                                         for word in ("environments", "dofs", "couplings", "substeps"))
    environments = [[engine, substeps] + cells("chain8/reduced/1/f32/environments", counts, words)
                    for engine, substeps, words in engine_words()]
    per_call = [[scene] + cells(f"{scene}/reduced/1/f32/substeps", calls) for scene in SCENES]
    chains = [[words] + cells(f"chain/reduced/1/f32/{part}dofs", lengths)
              for words, part in (("free", ""), ("half of them coupled", "coupled/"))]
    coupled = [[f"`{method_words(m, k)}`"] + cells(f"chain16/{m}/{k}/f32/couplings", couplings)
               for m, k in (("reduced", 1), ("direct", 1), ("pgs", 4))]
    return (section("Environments", table(["engine", "steps per call"] + counts, environments, 2))
            + section("Steps per call", table(["scene"] + calls, per_call))
            + section("Joints and couplings", table(["joints"] + lengths, chains),
                      table(["couplings"] + couplings, coupled, title="A chain of 16 joints with couplings:")))


def ladder(results):
    rows = []
    for method, name, words in LADDER:
        row = results.avx2.get(f"step/chain8/{method}/1/f32/ladder:{name}")
        if row:
            rows.append([words, row.flops, number(row.speed)])
    return section("Features", table(["with", "flops per step", "M steps/s"], rows, 2))


def bound_cell(found, bound, scene, method):
    none, own = (speed(found, f"step/{scene}/{method}/1/f32/bounds:{b}") for b in ("none", bound))
    if own is None:
        return NONE
    if (scene, bound) in NOT_REACHED:
        return "not reached"
    return number(own) if bound == "none" else f"{number(own)} ({none / own:.2f})"


def bounds(results):
    found = results.avx2
    columns = [(scene, method) for scene in SCENES[:2] for method in ("reduced", "direct", "pgs")]
    head = [f"{scene} {method}" for scene, method in columns]
    by_bound = [[words] + [bound_cell(found, bound, *column) for column in columns] for bound, words in BOUNDS]
    ranges = (("none", ""), ("never reached", "/bounds:limits-inactive"))
    inactive = [[engine, words] + [number(speed(found, f"step/{scene}/{method}/1/f32{part}/engine:{engine}"))
                                   for scene, method in columns] for engine in results.engines[1:] for words, part in ranges]
    return section("Bounds", table(["bounds"] + head, by_bound),
                   table(["engine", "position ranges"] + head, inactive, 2,
                         "By engine, with position ranges that are never reached:"))


def robots(results):
    rows = []
    for name, row in sorted(results.robots.items()):
        match = re.fullmatch(r"step/(.+)/(reduced|direct|pgs)/\d+/f32", name)
        if match:
            rows.append([match[1], match[2], number(speed(results.robots, name + "/engine:tables")), number(row.speed),
                         f"{row.gflops:.0f}"])
    return section("Robots from files", table(["robot", "method", "tables", "automatic", "Gflop/s"], rows, 2))


def accuracy():
    """From any machine that has the file, as errors are the same on all."""
    found = {}
    for path in sorted((BENCH / "results").glob("*/accuracy.csv")):
        for row in read(path):
            if row["engine"] == "lockstep" and row["settings"] in ("euler, f32", "euler, f64"):
                found[row["scene"], row["settings"][-3:], int(row["steps_per_second"])] = row
    rows = []
    for scene in SCENES:
        for precision in ("f32", "f64"):
            pair = [found.get((scene, precision, hz)) for hz in (240, 480)]
            if all(pair):
                rows.append([scene, precision] + [short(float(row["rms"])) for row in pair]
                            + [short(max(float(row["largest_c"]) for row in pair))])
    head = ["scene", "precision", "at 1/240 s", "at 1/480 s", "largest coupling error"]
    return section("Errors of Euler's step", table(head, rows, 2))


def page(results):
    peaks = [f"{isa}, {precision}: {results.avx2[name].gflops:.0f}" for isa, precision, name in (
        (isa, precision, f"peak/{isa.lower().replace('-', '')}_{precision}")
        for isa in ("AVX2", "AVX-512") for precision in ("f32", "f64")) if name in results.avx2]
    machine = results.folder / "machine.txt"
    machine = machine.read_text().strip() if machine.exists() else "this one"
    before = "" if "compiled" in results.engines else (
        "These figures are older than the engine `compiled`. The automatic engine was an interpreter then.\n\n")
    head = f"""# Results: speed

`bench/tables.py` writes this page from the CSV files in
[bench/results/{results.folder.name}](../../bench/results/{results.folder.name}). Do not edit it.
[Performance](../performance.md) explains the scenes and says what follows from the figures.

Machine: {machine}. Peak of fused multiply-adds on one core, Gflop/s:
{"; ".join(peaks)}.

{before}Where nothing else is said a figure is in million environment-steps per second of CPU time, on one core, with 4,096
environments and 4 steps per call, the median of the repeats. "–": not measured.

"""
    return (head + engines(results) + generated(results) + consistent(results) + methods(results) + integrators(results)
            + peers(results) + stages(results) + threads(results) + scaling(results) + ladder(results) + bounds(results)
            + robots(results) + accuracy()).rstrip("\n") + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, nargs="?", default=BENCH / "results" / MACHINE,
                        help="folder of one machine")
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument("--check", action="store_true", help="write nothing, only compare")
    choices = parser.parse_args()
    text = page(Results(choices.results.resolve()))
    if choices.check:
        if not choices.out.exists() or choices.out.read_text() != text:
            sys.exit(f"{choices.out}: differs from what {choices.results} says; run {Path(__file__).name}")
        return
    choices.out.parent.mkdir(parents=True, exist_ok=True)
    choices.out.write_text(text)
    print(choices.out)


if __name__ == "__main__":
    main()
