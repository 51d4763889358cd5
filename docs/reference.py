# Writes the reference in docs/python.md. SPDX-License-Identifier: Apache-2.0
"""PYTHONPATH=build/release/python python3 docs/reference.py [--check]

Makes what stands below the heading "Reference" of docs/python.md from the docstrings of the package. With --check it
writes nothing, and fails if the page differs from what they say. What is public must have a docstring."""

import argparse
import importlib
import inspect
import re
import sys
import textwrap
from pathlib import Path

import lockstep

PAGE = Path(__file__).resolve().parent / "python.md"
HEADING = "## Reference\n"
WORDS = """`python3 docs/reference.py` writes this part from the docstrings of the package, which `help()` shows,
too. Do not edit it. Shapes are in brackets: num_envs environments of a batch, k columns or, where a call is about some
environments, k of these; nv moving joints. Units are m, kg, s, rad, N and N m."""

# Titles, modules below lockstep ("" is lockstep itself), and what they have. reference() misses no name of lockstep.
SECTIONS = [
    ("Files and plans", "", "from_file from_urdf from_mjcf from_urdf_text from_mjcf_text export_mjcf export_urdf "
                            "Export compile load_kernel"),
    ("Models", "", "Model Link Inertia Joint TendonSegment Drive Coupling Polynomial CamTable Harmonic Loop Site Root NamedPose "
                   "Collider Shape Contact VisualMesh Hard ErpCfm Spring Frequency pose"),
    ("Plan", "", "Plan"),
    ("Batch", "", "Batch Rows"),
    ("Queries", "", "Query"),
    ("Starts", "", "Start RootNoise"),
    ("Recordings and pictures", "", "Recording"),
    ("", "rendering", "Renderer"),
    ("Errors", "", "Error ModelError ImportFileError SettingsError UsageError"),
    ("Environments", "vector", "VectorEnv"),
    ("Observations", "observations", "Observations Group Term Uniform Normal"),
    ("Rewards and ends", "rewards", "Rewards Terminations"),
    ("Events", "events", "Event"),
    ("Random numbers", "draws", "uniform normal"),
    ("Ground", "terrain", "Patch Terrain curriculum"),
    ("Many processes", "ranks", "rank_of_launcher ids_of require_partition Checkpoints Checkpoint"),
    ("", "mpi", "Ranks spread together"),
    ("Trainers", "rsl_rl", "RslRlEnv"),
    ("", "stable_baselines3", "Sb3VecEnv"),
    ("", "rl_games", "RlGamesEnv"),
    ("Conformance", "conformance", "check"),
]
OF_OTHERS = {"RslRlEnv", "Sb3VecEnv", "RlGamesEnv"}  # their methods are those of the trainer's documents
VALUES = {"__version__", "infinity", "Softness"}  # they have no docstring


# --- docstrings ------------------------------------------------------------------------------------


def documented(thing, path):
    """The docstring, without the signature that pybind11 writes on top."""
    text = re.sub(r"^\w+\(.*\)(?: -> .*)?(\n\n|$)", "", inspect.cleandoc(thing.__doc__ or "")).strip()
    if not text:
        sys.exit(f"{path} has no docstring")
    return text


def split(text):
    """What stands between the commas that no bracket holds."""
    parts, depth, begin = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append(text[begin:place])
            begin = place + 1
    return [part.strip() for part in (*parts, text[begin:]) if part.strip()]


def parameters(thing):
    """As they are written in a definition, without types."""
    written = re.match(r"\w+\((.*)\)(?: -> .*)?(?:\n\n|$)", thing.__doc__ or "")
    if written:
        return [re.sub(r"(\w+): .*?(?: = (.*)|$)", lambda one: one[1] + (f"={one[2]}" if one[2] else ""), part)
                for part in split(written[1])]
    untyped = inspect.signature(thing).replace(return_annotation=inspect.Signature.empty)
    untyped = untyped.replace(parameters=[one.replace(annotation=one.empty) for one in untyped.parameters.values()])
    return split(re.sub(r"<[^<>]*>", "...", str(untyped))[1:-1])


def call(name, thing, known=None):
    """name(parameters). Keywords that an earlier call in `known` has, too, are told as "**options"."""
    given = ", ".join(one for one in parameters(thing) if one != "self")
    before, star, keywords = given.partition("*, ")
    if known is not None and star:
        given = f"{before}**options" if keywords in known else given
        known.add(keywords)
    return f"`{name}({given})`"


# --- Markdown --------------------------------------------------------------------------------------


def paragraph(text):
    return [*textwrap.wrap(" ".join(text.split()), 120, break_long_words=False, break_on_hyphens=False), ""]


def prose(text):
    """Wrapped paragraphs. What is indented stands as it is written."""
    lines = []
    for block in text.split("\n\n"):
        for indented, part in re.findall(r"((?:^ .*\n?)+)|((?:^(?! ).*\n?)+)", block, re.M):
            lines += ["```text", *textwrap.dedent(indented).splitlines(), "```", ""] if indented else paragraph(part)
    return lines


def table(head, rows):
    lines = [head, ["---"] * len(head), *([" ".join(cell.split()).replace("|", "\\|") for cell in row] for row in rows)]
    return [*("| " + " | ".join(line) + " |" for line in lines), ""] if rows else []


def members(kind):
    """Tables of what a class has beside its fields, which the parameters of its constructor name."""
    values, calls = [], []
    for name, member in vars(kind).items():
        if name.startswith("_"):
            continue
        path = f"{kind.__name__}.{name}"
        if isinstance(member, property):
            values.append([f"`{name}`", documented(member, path)])
        elif callable(getattr(kind, name)):
            calls.append([call(name, getattr(kind, name)), documented(getattr(kind, name), path)])
    return [*table(["value", "what it is"], values), *table(["call", "what it does"], calls)]


def query_rows(text):
    """[quantities, rows, columns] of the lines of a table in Query's docstring."""
    rows = []
    for line in text.splitlines():
        found = re.match(r"((?:\w+, )*\w+) +((?:\w+, )*\w+|-) +(\d.*)", line)
        if found:
            rows.append(list(found.groups()))
        elif line.startswith(" "):
            rows[-1][2] += " " + line.strip()
    return rows


def queries(text):
    lines = []
    for block in text.split("\n\n"):
        rows = query_rows(block)
        if not rows:
            lines += paragraph(block)
            continue
        first = block.splitlines()[0]
        lines += paragraph(first) if first.endswith(":") else []
        lines += table(["quantity", "rows", "columns for each row"],
                       [[", ".join(f"`{one}`" for one in names.split(", ")), of, what] for names, of, what in rows])
    return lines


def entry(thing, path, known):
    is_class = isinstance(thing, type)
    is_given = is_class and (issubclass(thing, Exception) or thing.__module__.endswith("._lockstep"))
    lines = [f"**`{path}`**" if is_given else f"**{call(path, thing, known)}**", ""]
    if thing is lockstep.Query:
        return lines + queries(documented(thing, path))
    lines += prose(documented(thing, path))
    return lines + members(thing) if is_class and thing.__name__ not in OF_OTHERS else lines


def reference():
    told = {name for _, module, names in SECTIONS if not module for name in names.split()}
    if missing := set(lockstep.__all__) - told - VALUES:
        sys.exit(f"{', '.join(sorted(missing))} of lockstep: name it in SECTIONS of {Path(__file__).name}")
    lines = [HEADING, *paragraph(WORDS)]
    known = set()
    for title, module, names in SECTIONS:
        lines += [f"### {title}", ""] if title else []
        place = importlib.import_module(f"lockstep.{module}" if module else "lockstep")
        for name in names.split():
            lines += entry(getattr(place, name), f"{module}.{name}" if module else name, known)
    return "\n".join(lines).rstrip() + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing, only compare")
    check = parser.parse_args().check
    page = PAGE.read_text()
    text = page[:page.index(HEADING)] + reference()
    if not check:
        PAGE.write_text(text)
    elif page != text:
        sys.exit(f"{PAGE} differs from the docstrings: run PYTHONPATH=build/release/python python3 docs/reference.py")


if __name__ == "__main__":
    main()
