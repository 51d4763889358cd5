#!/usr/bin/env python3
"""How the time of `lockstep info` grows with the size of a model.

    python3 bench/growth.py [--lockstep build/release/src/tool/lockstep] [--most 4000] [KIND ...]

Writes models of several kinds and sizes, and prints the CPU seconds of each and the ratio to half its size. A size that
is refused says so. SPDX-License-Identifier: Apache-2.0
"""
import argparse
import pathlib
import resource
import subprocess
import tempfile

INERTIAL = '<inertial><mass value="0.2"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'


def joint(i, parent, limit=False, mimic=None):
    kind = "revolute" if limit else "continuous"
    inside = '<origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>'
    if limit:
        inside += '<limit lower="-1" upper="1" velocity="1e9" effort="1e9"/>'
    if mimic is not None:
        inside += f'<mimic joint="j{mimic}" multiplier="1"/>'
    return (f'<link name="l{i}">{INERTIAL}</link><joint name="j{i}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="l{i}"/>{inside}</joint>')


def chain(n, limit=False, follows=lambda i: None):
    return "".join(joint(i, f"l{i - 1}" if i else "base", limit, follows(i)) for i in range(n))


def star(n, limit=False, follows=lambda i: None):
    return "".join(joint(i, "base", limit, follows(i)) for i in range(n))


def grippers(n):
    """A joint that carries two fingers, which follow each other: three joints each."""
    return "".join(joint(i, "base" if i % 3 == 0 else f"l{i - i % 3}", True, i - 1 if i % 3 == 2 else None)
                   for i in range(n))


def urdf(body):
    return f'<robot name="growth"><link name="base"/>{body}</robot>'


def followers(n, parent, leader):
    """Couplings of MJCF: joint i follows joint leader(i). Those of URDF would be written as followers of one joint."""
    open_bodies = "".join(
        f'<body name="l{i}" pos="0.1 0 0"><joint name="j{i}" axis="0 1 0"/><inertial pos="0.05 0 0" mass="0.2" '
        f'diaginertia="1e-3 1e-3 1e-3"/>' + ("" if parent == "chain" else "</body>") for i in range(n))
    equalities = "".join(f'<joint joint1="j{i}" joint2="j{leader(i)}" polycoef="0 1 0 0 0"/>' for i in range(1, n))
    closing = "</body>" * n if parent == "chain" else ""
    return (f'<mujoco><worldbody>{open_bodies}{closing}</worldbody><equality>{equalities}</equality></mujoco>')


def balls(n):
    """Spheres on sliders, which touch the ground."""
    bodies = "".join(
        f'<body name="l{i}" pos="{0.3 * i} 0 1"><joint name="j{i}" type="slide" axis="0 0 1"/>'
        f'<geom name="g{i}" type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/></body>' for i in range(n))
    pairs = "".join(f'<pair geom1="ground" geom2="g{i}"/>' for i in range(n))
    return (f'<mujoco><worldbody><geom name="ground" type="plane" size="0 0 1" contype="0" conaffinity="0"/>{bodies}'
            f'</worldbody><contact>{pairs}</contact></mujoco>')


KINDS = {
    "chain": lambda n: urdf(chain(n)),
    "chain with limits": lambda n: urdf(chain(n, True)),
    "star": lambda n: urdf(star(n)),
    "star with limits": lambda n: urdf(star(n, True)),
    "chain of mimics": lambda n: urdf(chain(n, follows=lambda i: i - 1 if i else None)),
    "star of mimics": lambda n: urdf(star(n, follows=lambda i: 0 if i else None)),
    "star, each is coupled to the one before": lambda n: followers(n, "star", lambda i: i - 1),
    "star, all are coupled to one": lambda n: followers(n, "star", lambda i: 0),
    "grippers": lambda n: urdf(grippers(n)),
    "contacts": balls,
}


def seconds_of(command):
    """CPU seconds, and why it was refused."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, done.stderr.strip() if done.returncode else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lockstep", default="build/release/src/tool/lockstep")
    parser.add_argument("--most", type=int, default=4000)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="; ".join(KINDS))
    options = parser.parse_args()
    sizes = [500]
    while 2 * sizes[-1] <= options.most:
        sizes.append(2 * sizes[-1])
    print("| kind | joints | s | of half the size |\n| --- | --- | --- | --- |")
    for kind in options.kinds or KINDS:
        last = None
        for n in sizes:
            text = KINDS[kind](n)
            with tempfile.TemporaryDirectory() as folder:
                path = pathlib.Path(folder) / ("model.xml" if text.startswith("<mujoco") else "model.urdf")
                path.write_text(text)
                seconds, refusal = seconds_of([options.lockstep, "info", str(path)])
            grown = f"{seconds / last:.1f}" if last and not refusal else "refused" if refusal else ""
            print(f"| {kind} | {n} | {seconds:.2f} | {grown} |", flush=True)
            if refusal:
                print(f"<!-- {refusal} -->")
            last = None if refusal else seconds


main()
