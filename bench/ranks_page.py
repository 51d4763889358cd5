# The page of ranks, for result_pages.py. SPDX-License-Identifier: Apache-2.0
import json
from statistics import median, quantiles

NODES, CORES = 64, 64
NETWORK, LATENCY = 12.5e9, 2e-6  # byte/s of a node (100 Gbit/s), s a message: assumed, not measured
WEIGHTS = 50_000                 # of a policy whose gradients ranks share, 4 bytes each
WAYS = {"one": "1 process, 1 thread", "threads": "1 process, {cores} threads, no MPI",
        "ranks": "{cores} ranks, 1 thread each", "half": "1 process, 1 thread, its share of the environments"}


def milliseconds(seconds):
    return f"{1e3 * seconds:.2f}"


def spread(values):
    low, _, high = quantiles(values, n=4)
    return f"{100 * (high - low) / median(values):.0f} %"


def paired(rows, one, other):
    """The median of one way's time over the other's in the same turn."""
    return median(a["seconds"] / b["seconds"] for a, b in zip(rows[one], rows[other]))


def hops(ranks):
    """Of a message that reaches all ranks by a tree."""
    return (ranks - 1).bit_length()


def costs(rows):
    """From one rank: p, seconds of rank 0's actions; s, seconds of an environment's steps on a core; b, bytes of its
    actions and readings; B, bytes a second that go from rows to rows."""
    one = rows["one"]
    environments = one[0]["environments"]
    size = 4 * (one[0]["actions"] + one[0]["readings"])
    exchange = median(row["scatter"] + row["gather"] for row in one)
    return (median(row["act"] for row in one), median(row["step"] for row in one) / environments, size,
            environments * size / exchange)


def control_step(acting, step, size, bandwidth, ranks, environments):
    """Seconds, by the formula of the page."""
    messages = 2 * (ranks - 1) + 6 * hops(ranks)
    return acting + environments / ranks * step + environments * size / bandwidth + messages * LATENCY


def planned(rows, per_core):
    """By nodes: a policy on rank 0, and policies on all ranks."""
    _, step, size, bandwidth = costs(rows)
    result = []
    for nodes in (1, 4, 16, NODES):
        ranks = nodes * CORES
        environments = ranks * per_core
        stepping = step * per_core
        central = control_step(0.0, step, size, min(bandwidth, NETWORK), ranks, environments)
        shared = stepping + 2 * (4 * WEIGHTS / NETWORK + hops(ranks) * LATENCY)
        result.append([str(nodes), f"{environments / 1e3:.0f} k", milliseconds(stepping), milliseconds(central),
                       f"{100 * stepping / central:.0f} %", milliseconds(shared), f"{100 * stepping / shared:.0f} %"])
    return result


def ranks_page(path, written, words, markdown, link):
    with open(path) as file:
        data = json.load(file)
    cores = data["cores"]
    lines = ["# Results: ranks", ""] + words(
        written.format(link(path, "the results of `bench/ranks.py`")),
        f"[ranks](../ranks.md) says what a rank is. Measured on {data['machine']}, a shared virtual machine: medians of "
        f"{len(next(iter(data['scenes'].values()))['one'])} turns, in each of which all ways ran one after the other. A "
        "control step is random actions by rank 0, which go to the ranks, four steps of 1/240 s, resets of whose turn it "
        "is, and positions and velocities, which come back to rank 0. Masses and actions differ between environments.")
    for scene, rows in data["scenes"].items():
        table = []
        for way, name in WAYS.items():
            own = rows[way]
            part = {key: median(row[key] for row in own) for key in ("seconds", "act", "scatter", "step", "gather")}
            table.append([name.format(cores=cores), str(own[0]["environments"]), milliseconds(part["seconds"]),
                          spread([row["seconds"] for row in own]), milliseconds(part["step"]),
                          f"{100 * (1 - part['step'] / part['seconds']):.1f} %", f"{own[0]['bytes'] / 1e3:.0f} kB",
                          str(own[0]["messages"])])
        strong, weak = paired(rows, "one", "ranks"), paired(rows, "half", "ranks")
        lines += [f"## {scene.capitalize()}", ""]
        lines += markdown(["way", "environments", "ms a control step", "spread", "of it in steps", "outside of steps",
                           "rows through MPI", "messages with rows"], table)
        expected = control_step(*costs(rows), cores, rows["one"][0]["environments"])
        lines += words(
            f"{cores} ranks take {paired(rows, 'ranks', 'threads'):.3f} times the time of one process with {cores} "
            f"threads (median of paired turns). Strong scaling: {strong:.2f} times as fast as one rank, "
            f"{100 * strong / cores:.0f} % of {cores}. Weak scaling: one rank with its share takes {100 * weak:.0f} % of the "
            f"time of {cores} ranks with all. The formula below has its costs from 1 rank; for {cores} ranks it says "
            f"{milliseconds(expected)} ms.")
    lines += ["## On paper: 64 nodes of 64 cores", ""] + words(
        "A control step of N environments on R ranks takes",
    ) + ["```math", r"T = p + \frac{N}{R}\, s + \frac{N\, b}{B} + \big(2 (R - 1) + 6 \lceil \log_2 R \rceil\big)\, L ,",
         "```", ""] + words(
        "where p is the time of the policy on rank 0 (here it draws random actions), s the time of an environment's steps "
        "on a core, b the bytes of its actions and readings, B how many bytes a second rank 0 exchanges, and L the latency "
        "of a message: each rank but rank 0 has one for actions and one for readings, and to agree on shapes there are "
        "four small collective calls. p, s, b and B are measured with one rank. On paper B is at most "
        f"{NETWORK / 1e9:g} GB/s, a network of 100 Gbit/s, and L is {1e6 * LATENCY:g} us; both are assumed. Cores of a node are "
        "taken to be as fast together as alone, which they are not where they share caches, memory and power.",
        "With the policy on rank 0, rank 0 is the limit: all rows pass it. Where each rank has the policy and learns from "
        f"its own environments, gradients go between nodes ({WEIGHTS} weights, once a control step at most, by "
        "recursive halving), and what does not shrink with the nodes grows by a logarithm. So beyond one node each rank "
        "should have the policy, as in `train_ppo_ranks.py`.")
    for scene, per_core in (("gripper", 1024), ("quadruped", 128)):
        rows = data["scenes"][scene]
        _, step, size, bandwidth = costs(rows)
        lines += words(f"{scene.capitalize()}, {per_core} environments a core, s = {1e6 * step:.2f} us, b = {size} bytes, "
                       f"B = {min(bandwidth, NETWORK) / 1e9:.1f} GB/s, without p:")
        lines += markdown(["nodes", "environments", "ms of steps", "ms, policy on rank 0", "of it in steps",
                           "ms, policy on all", "of it in steps"], planned(rows, per_core))
    return "\n".join(lines)
