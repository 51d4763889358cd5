# The tables of docs/performance.md and docs/kernels.md, from the CSV files of measure.py. SPDX-License-Identifier: Apache-2.0
"""Prints Markdown: million environment-steps per second, medians, and the fastest repeats of rows of threads."""
import argparse
import csv
import re
from pathlib import Path

from rows import rates

SCENES = ["chain8", "gripper13", "chain32"]
METHODS = [("reduced", 1), ("direct", 1), ("pgs", 1), ("pgs", 4), ("pgs", 16), ("tgs", 1), ("tgs", 4), ("tgs", 16)]


def read(path):
    with open(path, newline="") as file:
        return rates(csv.DictReader(file))


def number(value):
    return "" if value is None else f"{value:.2g}" if value < 10 else f"{value:.3g}"


def table(head, rows):
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


def speed(found, name):
    return found[name][0] if name in found else None


def methods(found, title):
    print(title + "\n")
    rows = []
    for scene in SCENES:
        for precision in ("f32", "f64"):
            cells = [found.get(f"step/{scene}/{m}/{k}/{precision}") for m, k in METHODS]
            rows.append([scene, precision] + [f"{number(c[0])} ({c[1]:.0f})" if c else "" for c in cells])
    table(["scene", "precision"] + [m if m in ("reduced", "direct") else f"{m} {k}" for m, k in METHODS], rows)


def generated(avx2, avx512):
    print("The three ways\n")
    rows = []
    for scene in SCENES:
        for m, k in (("reduced", 1), ("pgs", 4), ("direct", 1)):
            name = f"step/{scene}/{m}/{k}/f32"
            cells = [speed(f, n) for f in (avx2, avx512) for n in
                     (f"{name}/kernel:tables", f"{name}/kernel:listed", f"{name}/kernel:generated",
                      f"{name}/substeps:1/kernel:generated")]
            rows.append([scene, m if k == 1 else f"{m} {k}"] + [number(c) for c in cells])
    words = ["tables", "listed", "generated", "generated, 1 step per call"]
    table(["scene", "method"] + [f"{isa}, {w}" for isa in ("avx2", "avx512") for w in words], rows)
    rows = []
    for n in (4, 8, 16, 20, 24, 32, 64):
        name = f"step/chain/reduced/1/f32/coupled/dofs:{n}"
        rows.append([str(n)] + [number(speed(f, name + x)) for f in (avx2, avx512)
                                for x in ("/kernel:tables", "/kernel:listed", "/kernel:generated")])
    table(["joints"] + [f"{isa}, {w}" for isa in ("avx2", "avx512") for w in words[:3]], rows)


def rest(found):
    for pattern in (r"ladder:(.+)", r"bounds:(.+)", r"(?:environments|threads|substeps):\d+(?:/.*)?$", r"peak/.*"):
        rows = [[name, flops, number(value), f"{gflops:.0f}"] for name, (value, gflops, flops) in sorted(found.items())
                if re.search(pattern, name)]
        table(["row", "flops per step", "M steps/s", "Gflop/s"], rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="folder of one machine")
    results = parser.parse_args().results
    avx2 = read(results / "step_bench.csv")
    wide = results / "step_bench_avx512.csv"
    avx512 = read(wide) if wide.exists() else {}
    methods(avx2, "AVX2, as a batch steps by itself")
    if avx512:
        methods(avx512, "AVX-512, as a batch steps by itself")
    generated(avx2, avx512)
    rest(avx2)


if __name__ == "__main__":
    main()
