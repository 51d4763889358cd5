# The rows of step_bench's tables, as pictures and documents show them. SPDX-License-Identifier: Apache-2.0
import re


def rates(table):
    """By name: million steps per second, Gflop/s and flops per step. Medians, but the fastest repeats where threads are
    compared; of a single repeat, which has no statistics, itself."""
    found = {}
    for row in table:
        name, statistic = re.fullmatch(r"(.*?)(_median|_best)?", row["name"]).groups()
        name = re.sub("/real_time$|/iterations:[0-9]+", "", name)
        if row["env_steps_per_second"] and (statistic == "_best" or name not in found):
            found[name] = (float(row["env_steps_per_second"]) * 1e-6, float(row["gflops"]), row["flops_per_step"])
    return found
