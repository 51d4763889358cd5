#!/usr/bin/env python3
"""Compares the bits of two builds: every plan of bits.cpp, by every engine, target and precision.

    python3 tests/bits/compare.py OLD_SOURCE OLD_BUILD NEW_SOURCE NEW_BUILD

Both builds have tests. Compiles bits.cpp against each with its own generated kernels, runs both and prints what differs.
Exits with 1 where lines differ or are missing. SPDX-License-Identifier: Apache-2.0
"""
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent


def lines_of(source, build, folder):
    program = pathlib.Path(folder) / "bits"
    kernels = build / "tests/generated/CMakeFiles"
    objects = sorted(kernels.glob("generated_test_*.dir/**/*.o")) + sorted(kernels.glob("generated_test.dir/**/*_registered.cpp.o"))
    libraries = [build / name for name in (
        "tests/generated/libgenerated_plans.a", "tests/liblockstep_physics.a", "tests/scenes/liblockstep_scenes.a",
        "src/reference/liblockstep_reference.a")]
    libraries += [path for path in (build / "tests/twins/liblockstep_twins.a", build / "src/liblockstep.a") if path.exists()]
    subprocess.run(["g++", "-std=c++20", "-O1", "-I/usr/include/eigen3", *(f"-I{source / d}" for d in ("include", "src", "tests")),
                    str(HERE / "bits.cpp"), "-o", str(program), *map(str, objects), "-Wl,--start-group", *map(str, libraries),
                    "-Wl,--end-group", "-lgtest", "-lfmt", "-ltbb", "-ltinyxml2", "-lqhull_r", "-lpng", "-lz"], check=True)
    output = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return dict(line.rsplit(" ", 1) for line in output.splitlines())


def main():
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    paths = [pathlib.Path(p).resolve() for p in sys.argv[1:]]
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        old, new = lines_of(paths[0], paths[1], one), lines_of(paths[2], paths[3], other)
    differ = sorted(name for name in old.keys() | new.keys() if old.get(name) != new.get(name))
    for name in differ:
        print(f"{name}: {old.get(name, 'missing')} {new.get(name, 'missing')}")
    print(f"{len(old)} and {len(new)} lines, {len(differ)} differ")
    sys.exit(1 if differ or not old else 0)


main()
