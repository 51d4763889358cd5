# Errors. SPDX-License-Identifier: Apache-2.0
"""Every error names the element, the rule that it breaks and the remedy. docs/errors.md lists the codes."""

import re
from typing import Any, Sequence, Tuple

_IN_PYTHON = {"Plan::contacts()": "Plan.contact_names", "StepSettings::per_environment": "compile(vary=...)",
              "StepSettings::record_diagnostics": "compile(diagnostics=...)"}
_CALLS = {"StepSettings": "compile({}=...)", "BatchOptions": "Plan.batch({}=...)", "ImportOptions": "from_file({}=...)",
          "Parameter": "'{}'"}


def _in_python(text: str) -> str:
    """The words of C++ as those of Python."""

    def word(found: "re.Match[str]") -> str:
        kind, name = found.group(1), found.group(2)
        return _IN_PYTHON.get(found.group(0)) or _CALLS.get(kind, kind + ".{}").format(name)

    return re.sub(r"\b(Plan|Batch|Model|Joint|StepSettings|BatchOptions|ImportOptions|Parameter)::(\w+(?:\(\))?)", word, text)


class Error(ValueError):
    """str(error) is "element: rule; remedy". Codes, such as "model.joint", stay the same when the words change. A file
    may be refused for several reasons: str(error) has a line for each, and `reasons` lists them all as (element, rule,
    remedy)."""

    def __init__(self, element: str, rule: str, remedy: str, code: str,
                 others: Sequence[Tuple[str, str, str]] = ()) -> None:
        self.reasons = [tuple(map(_in_python, reason)) for reason in [(element, rule, remedy), *others]]
        super().__init__("\n".join(f"{reason[0]}: {reason[1]}; {reason[2]}" for reason in self.reasons))
        self.code = code
        self.element, self.rule, self.remedy = self.reasons[0]

    def __reduce__(self) -> Tuple[Any, ...]:
        return type(self), (self.element, self.rule, self.remedy, self.code, self.reasons[1:])


class ModelError(Error):
    """The mechanism is impossible or incomplete."""


class ImportFileError(Error):
    """A file cannot be read as a mechanism."""


class SettingsError(Error):
    """A setting is out of its range, or does not apply to this model."""


class UsageError(Error, IndexError):
    """A plan or batch was asked for something that it does not hold, or was used by two threads at once."""
