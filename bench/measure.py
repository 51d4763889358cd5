# Runs all measurements of a build and draws them. SPDX-License-Identifier: Apache-2.0
"""CSV files go to bench/results/MACHINE, pictures to docs/performance, tables to docs/results/performance.md. The build
must be finished."""
import argparse
import csv
import os
import re
import subprocess
import sys
import time
from pathlib import Path

BENCH = Path(__file__).resolve().parent
RESULTS = BENCH / "results"


def machine():
    """The folder of results whose machine.txt describes this processor, or a new one named after it."""
    with open("/proc/cpuinfo") as file:
        lines = file.read().split("\n\n")[0].splitlines()
    facts = dict(re.split(r"\s*:\s*", line.strip(), maxsplit=1) for line in lines if ":" in line)
    text = "{model name}, family {cpu family}, model {model}\n".format(**facts)
    for known in RESULTS.glob("*/machine.txt"):
        if known.read_text() == text:
            return known.parent
    folder = RESULTS / re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    folder.mkdir(parents=True)
    (folder / "machine.txt").write_text(text)
    return folder


def python_that_draws():
    """This Python, or the system's if this one has no matplotlib."""
    for python in (sys.executable, "/usr/bin/python3"):
        if subprocess.run([python, "-c", "import matplotlib"], capture_output=True).returncode == 0:
            return python
    sys.exit("measure.py: no matplotlib (Debian: python3-matplotlib)")


def run(words, **more):
    print("  " + " ".join(str(word) for word in words), flush=True)
    start = time.monotonic()
    subprocess.run([str(word) for word in words], check=True, **more)
    print(f"  {time.monotonic() - start:.0f} s", flush=True)


def step_bench(program, table, quick, target, chosen=".", robots=()):
    if quick:
        chosen = "peak|reduced/1/f32/(coupled/)?(dofs|threads|environments)|couplings"
    run(["env", f"LOCKSTEP_TARGET={target}", program, f"--benchmark_filter={chosen}",
         f"--benchmark_min_time={0.003 if quick else 0.02}",
         f"--benchmark_repetitions={1 if quick else 9}", "--benchmark_enable_random_interleaving=true",
         f"--benchmark_report_aggregates_only={'false' if quick else 'true'}",
         f"--benchmark_out={table}", "--benchmark_out_format=csv", *robots],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    # Keeps the medians. The lines before the header describe the machine.
    rows = table.read_text()[table.read_text().index("name,"):].splitlines(keepends=True)
    table.write_text("".join(row for row in rows if not re.search('_(mean|stddev|cv)"', row)))


def kernels(folder, table):
    """Sizes of the generated kernels: operations from the source's first lines, code from the object file for AVX2."""
    pattern = r"(\d+) operations, \d+ flops(?:;\s*// (\d+), \d+ where)?"
    with open(table, "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["kernel", "operations", "consistent_operations", "code_kb"])
        for source in sorted(folder.glob("generated/*.cpp")):
            operations, consistent = re.search(pattern, source.read_text()).groups()
            code = next(folder.rglob(f"*_{source.stem}_avx2.dir/**/{source.name}.o"))
            sizes = subprocess.run(["size", code], capture_output=True, check=True, text=True).stdout.splitlines()
            out.writerow([source.stem, operations, consistent or "", f"{int(sizes[1].split()[0]) / 1000:.0f}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=BENCH.parent / "build", help="folder of a Release build")
    parser.add_argument("--pictures", type=Path, default=BENCH.parent / "docs" / "performance")
    parser.add_argument("--quick", action="store_true", help="takes less than a minute; the figures are not results")
    parser.add_argument("--robots", type=Path, nargs="+", metavar="URDF", help="robot files to measure too")
    choices = parser.parse_args()
    python = python_that_draws()
    if os.getloadavg()[0] > 0.5:
        print("This machine is busy: ratios are still good, but two threads will seem to gain nothing.")
    if choices.quick:
        results = choices.pictures = choices.build / "bench" / "quick"
        results.mkdir(parents=True, exist_ok=True)
    else:
        results = machine()
    programs = choices.build / "bench"
    # The figures are for AVX2, which most machines have, and also for AVX-512 if this machine has it.
    step_bench(programs / "step_bench", results / "step_bench.csv", choices.quick, "avx2")
    with open("/proc/cpuinfo") as file:
        wide = "avx512vl" in file.read()
    if wide and not choices.quick:
        step_bench(programs / "step_bench", results / "step_bench_avx512.csv", False, "avx512",
                   "(kernel|engine):|(chain8|gripper13|chain32)/[a-z]*/[0-9]*/f[0-9]*$|coupled/dofs|threads|peak")
    if choices.robots:
        names = "|".join(re.escape(file.stem) for file in choices.robots)
        step_bench(programs / "step_bench", results / "robots.csv", False, "avx2", f"^step/({names})/", choices.robots)
    if (programs / "kernels" / "generated").is_dir():
        kernels(programs / "kernels", results / "kernels.csv")
    run([programs / "stage_bench", "--csv", results / "stage_bench.csv"]
        + (["--repeats", 3, "--seconds", 0.001] if choices.quick else []))
    run([programs / "peers" / "peers", "--csv", results / "peers.csv"]
        + (["--repeats", 1, "--seconds", 0.01, "--horizon", 1] if choices.quick else []))
    run([python, BENCH / "charts.py", results, choices.pictures])
    page = results / "performance.md" if choices.quick else BENCH.parent / "docs" / "results" / "performance.md"
    run([python, BENCH / "tables.py", results, "--out", page])
    print(f"CSV files: {results}\npictures: {choices.pictures}\ntables: {page}")


if __name__ == "__main__":
    main()
