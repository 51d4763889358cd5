# The page of the soak, for result_pages.py. SPDX-License-Identifier: Apache-2.0
import json


def million(count):
    if count >= 999.5e6:
        return f"{count / 1e9:.3g} billion"
    return f"{count / 1e6:.3g} million" if count >= 1e6 else f"{count}"


def counts(table, head, markdown):
    ordered = sorted(table.items(), key=lambda item: (-item[1], item[0]))
    return markdown(head, [[name, str(count)] for name, count in ordered])


def gentle_rows(totals):
    lines = []
    for precision, gentle in zip(("single", "double"), totals["gentle"]):
        faults = sum(gentle["faults"].values())
        lines.append([precision, million(gentle["starts"]), str(faults), f"{gentle['coupling_error']['value']:.1e}",
                      f"{gentle['beyond']} of {million(gentle['looked'])}", f"{gentle['beyond_limit']['value']:.1e}",
                      f"{gentle['gains']} of {million(gentle['audited'])}", f"{gentle['gain']['value']:.2g}"])
    return lines


def soak_page(path, written, words, markdown, link):
    with open(path) as file:
        totals = json.load(file)
    refused = sum(totals["refused"].values())
    failures = len(totals["failures"])
    broken = f"**{failures} promises were broken**" if failures else "Since the last repair no promise was broken"
    lines = ["# Results: soak", ""] + words(
        written.format(link(path, "the counts of the soak")),
        "[reliability](../reliability.md#soaking) says what a soak does. "
        f"{million(totals['models'])} random models took {million(totals['steps'])} environment-steps in "
        f"{totals['cpu_seconds'] / 3600:.1f} hours of processor time; `compile()` refused {refused} more. {broken}: "
        f"{million(totals['compared_steps'])} environment-steps of two threads that went on from {totals['saves']} "
        "savepoints had the bits of one thread, and every state that was not finite had a fault. "
        f"{million(totals['resets'])} resets. The process held {totals['memory_early']:.0f} MB after 512 models, and "
        f"{totals['memory']:.0f} MB at the end.")
    lines += [f"FAILED {failure}" for failure in totals["failures"]]
    lines += ["Models by integrator and engine:", ""] + counts(totals["ways"], ["way", "models"], markdown)
    lines += ["Models that have a feature:", ""] + counts(totals["features"], ["feature", "models"], markdown)
    lines += ["Refused by `compile()`, by [code](../errors.md):", ""] + counts(
        totals["refused"], ["code", "models"], markdown)
    lines += ["Faults in all motions, one for each time that an environment was frozen:", ""] + counts(
        totals["faults"], ["fault", "environments"], markdown)
    lines += ["## Gentle motion", ""] + words(
        "Half of the models move gently: starts near the model's own with up to 0.1 rad/s, targets within a tenth of a "
        "radian, efforts within 0.2 N m. Coupling errors are those of eliminated couplings. Ranges are those of models "
        "whose ranges are all hard; joints may start beyond them where couplings put them there. The gain is what "
        "$\\Delta E$ is beyond $W_d + W_c$ in (M65), by the energy at hand, of models without contacts and loops that "
        "record diagnostics: Euler's own error.")
    lines += markdown(["precision", "starts", "faults", "largest coupling error", "more than 1e-3 beyond a range",
                       "largest", "gains of 0.1 and more", "largest"], gentle_rows(totals))
    for precision, gentle in zip(("Single", "Double"), totals["gentle"]):
        if gentle["faults"]:
            lines += [f"{precision} precision, faults by what found them:", ""] + counts(
                gentle["faults"], ["fault, found by", "environments"], markdown)
    if totals["reasons"]:
        lines += ["The first ones in words:", ""]
        for reason in totals["reasons"][:12]:
            lines += words("- " + " ".join(reason.split()))
        lines.append("")
    return "\n".join(lines)
