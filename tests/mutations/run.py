#!/usr/bin/env python3
# Breaks the library in stated ways and sees that tests notice. SPDX-License-Identifier: Apache-2.0
"""python3 tests/mutations/run.py [NAME ...] [--list] [--build FOLDER] [--jobs N]

mutations.toml states each break: a place in a source file, what stands there instead, and the test that must fail. The
breaks are made in a copy of the sources, build/mutations/source, one at a time; the copy is built with little
optimisation, for the instruction set that all processors have, without machine code. A break is caught if its test
fails or ends by a signal within a minute; a build that fails is no catch. First each test must pass on the
sources as they are.

Prints a line for each and a summary. Exit code 0: all are caught. It needs Python 3.11 and no other module, and
Ninja."""
import argparse
import os
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIST = ROOT / "tests/mutations/mutations.toml"
SECONDS = 60
KERNELS = "src/kernels/"
COMPILE_KERNELS = {"agreement_test", "contact_shapes_test"}  # they also call kernels that they compile themselves


def run(command, timeout=None):
    """Exit code (None after `timeout` seconds), output, seconds."""
    begin = time.monotonic()
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=timeout,
                              check=False, errors="replace")
        return done.returncode, done.stdout, time.monotonic() - begin
    except subprocess.TimeoutExpired as late:
        return None, (late.stdout or b"").decode(errors="replace"), time.monotonic() - begin


def copy_sources(to):
    """What git knows, files that have not changed untouched, so that little is compiled anew."""
    names = subprocess.run(["git", "-C", ROOT, "ls-files", "-z"], stdout=subprocess.PIPE, text=True,
                           check=True).stdout.split("\0")
    for name in filter(None, names):
        source, copy = ROOT / name, to / name
        if not source.is_file() or (copy.is_file() and copy.read_bytes() == source.read_bytes()):
            continue
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, copy)


def read_list(names):
    with open(LIST, "rb") as file:
        mutations = tomllib.load(file)["mutation"]
    known = {m["name"] for m in mutations}
    if len(known) < len(mutations):
        sys.exit("mutations.toml: two breaks have one name; rename one")
    if unknown := set(names) - known:
        sys.exit(f"mutations.toml: has no {', '.join(sorted(unknown))}; see --list")
    for m in mutations:
        found = (ROOT / m["file"]).read_text().count(m["old"])
        if found != 1:
            sys.exit(f"{m['name']}: its text stands {found} times in {m['file']}; state a text that stands there once")
    return [m for m in mutations if not names or m["name"] in names]


class Build:
    def __init__(self, folder, jobs):
        self.source, self.binary, self.jobs = folder / "source", folder / "build", jobs
        copy_sources(self.source)
        # No warnings: some come with little optimisation alone, and a break may leave a variable unused.
        code, output, _ = run([
            "cmake", "-S", self.source, "-B", self.binary, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug",
            "-DCMAKE_CXX_FLAGS_DEBUG=-O1 -w", "-DLOCKSTEP_TARGETS=", "-DLOCKSTEP_COMPILED=OFF",
            "-DLOCKSTEP_BUILD_BENCH=OFF", "-DLOCKSTEP_BUILD_PYTHON=OFF", "-DLOCKSTEP_INSTALL=OFF"])
        if code != 0:
            sys.exit(output)

    def build(self, program):
        code, output, _ = run(["cmake", "--build", self.binary, "--target", program, "-j", str(self.jobs)])
        return None if code == 0 else output

    def test(self, mutation):
        found = self.binary.rglob(mutation["test"])
        program = next(path for path in found if path.is_file() and os.access(path, os.X_OK))
        if "filter" in mutation:
            arguments = [f"--gtest_filter={mutation['filter']}", "--gtest_brief=1", "--gtest_fail_fast"]
        else:
            arguments = [self.source / argument for argument in mutation["files"]]
        return run([program, *arguments], SECONDS)

    def kernel_objects(self, mutation):
        """What a break of a kernel is compiled into: one file, as the others that include kernels take four times as
        long. They are the scalar twins, which tests compare steps with, and what traces and measures a step."""
        objects = [self.binary / "src/CMakeFiles/lockstep.dir/targets/baseline.cpp.o"]
        if mutation["test"] in COMPILE_KERNELS:
            objects += (self.binary / f"tests/CMakeFiles/{mutation['test']}.dir").rglob("*.o")
        return objects

    def write(self, mutation, text):
        path = self.source / mutation["file"]
        times = path.stat()
        path.write_text(text)
        if not mutation["file"].startswith(KERNELS):
            return
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # nothing is older than it
        for file in self.kernel_objects(mutation):
            file.unlink(missing_ok=True)

    def mutate(self, mutation):
        """Makes the break. Returns what takes it back."""
        text = (self.source / mutation["file"]).read_text()
        self.write(mutation, text.replace(mutation["old"], mutation["new"]))
        return lambda: self.write(mutation, text)


def test_name(mutation):
    return f"{mutation['test']} {mutation.get('filter', '')}".rstrip()


def failed_tests(output):
    return sorted({line.split("]", 1)[1].split(",")[0].split("(")[0].strip() for line in output.splitlines()
                   if line.startswith("[  FAILED  ]") and "." in line})


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="breaks to make (default: all)")
    parser.add_argument("--list", action="store_true", help="tells the breaks and makes none")
    parser.add_argument("--build", default=ROOT / "build/mutations", type=Path, help="folder for the copy")
    parser.add_argument("--jobs", default=os.cpu_count(), type=int)
    options = parser.parse_args()
    mutations = read_list(options.names)
    if options.list:
        for m in mutations:
            print(f"{m['name']:32} {m['breaks']}  [{test_name(m)}]")
        return 0

    begin = time.monotonic()
    build = Build(options.build, options.jobs)
    for program in sorted({m["test"] for m in mutations}):
        print(f"building {program}", file=sys.stderr, flush=True)
        if error := build.build(program):
            sys.exit(error)
    for m in {test_name(m): m for m in mutations}.values():
        code, output, seconds = build.test(m)
        if code != 0 or "[  PASSED  ] 0 tests" in output:
            sys.exit(f"{test_name(m)} does not pass without a break ({seconds:.0f} s):\n{output}")

    missed = []
    for number, m in enumerate(mutations, 1):
        print(f"{number} of {len(mutations)}: {m['name']}", file=sys.stderr, flush=True)
        take_back = build.mutate(m)
        try:
            error = build.build(m["test"])
            code, output, seconds = (0, error, 0.0) if error else build.test(m)
        finally:
            take_back()
        if error:
            print(error[-2000:], file=sys.stderr)
            says = "does not compile"
        elif code == 0:
            says = "MISSED"
        elif code is None:
            says = f"MISSED: more than {SECONDS} s"
        elif code < 0:
            says = f"caught by signal {-code}, {seconds:.1f} s"
        else:
            says = f"caught by {', '.join(failed_tests(output)[:2]) or m['test']}, {seconds:.1f} s"
        if error or code in (0, None):
            missed.append(m["name"])
        print(f"{m['name']:32} {says}", flush=True)
    minutes = (time.monotonic() - begin) / 60
    print(f"{len(mutations) - len(missed)} of {len(mutations)} caught in {minutes:.0f} minutes" +
          (f"; not {', '.join(missed)}" if missed else ""))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
