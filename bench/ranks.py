# Measures ranks of MPI on the cores at hand. SPDX-License-Identifier: Apache-2.0
"""python3 bench/ranks.py [--build build/release] [--turns 10] [--cores 2]

Runs ranks_bench with one process of one and of all threads, and with a rank for each core, in turn; writes
bench/results/ranks.json, from which result_pages.py makes docs/results/ranks.md. Needs mpirun and the standard
library."""
import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "bench/results/ranks.json"
SCENES = {"gripper": ("tests/models/gripper.urdf", 8192),
          "quadruped": ("docs/examples/python/models/quadruped.xml", 1024)}


def measured(build, scene, ranks, threads, environments, more=()):
    command = ["mpirun", "-n", str(ranks), "--oversubscribe", "--bind-to", "none", build / "bench/ranks_bench",
               ROOT / SCENES[scene][0], "--envs", str(environments), "--threads", str(threads), "--updates", "60", *more]
    environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def processor():
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":")[1].strip()
    return "unknown processor"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[1])
    parser.add_argument("--build", type=Path, default=ROOT / "build/release")
    parser.add_argument("--turns", type=int, default=10)
    parser.add_argument("--cores", type=int, default=len(os.sched_getaffinity(0)))
    options = parser.parse_args()
    rows = {}
    for turn in range(options.turns):
        for scene, (_, environments) in SCENES.items():
            cores = options.cores
            for name, ranks, threads, count, more in (
                    ("one", 1, 1, environments, ()),
                    ("threads", 1, cores, environments, ("--lone",)),
                    ("ranks", cores, 1, environments, ()),
                    ("half", 1, 1, environments // cores, ())):
                row = measured(options.build.resolve(), scene, ranks, threads, count, more)
                rows.setdefault(scene, {}).setdefault(name, []).append(row)
        print(f"turn {turn + 1} of {options.turns}", file=sys.stderr, flush=True)
    RESULTS.write_text(json.dumps({"machine": f"{options.cores} cores of {processor()}", "cores": options.cores,
                                   "scenes": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
