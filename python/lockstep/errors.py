# Errors. SPDX-License-Identifier: Apache-2.0
"""Every error names the element, the rule that it breaks and the remedy. docs/errors.md lists the codes."""


class Error(ValueError):
    """str(error) is "element: rule; remedy". Codes, such as "model.joint", stay the same when the words change."""

    def __init__(self, element: str, rule: str, remedy: str, code: str) -> None:
        super().__init__(f"{element}: {rule}; {remedy}")
        self.code = code
        self.element = element
        self.rule = rule
        self.remedy = remedy

    def __reduce__(self) -> tuple[type["Error"], tuple[str, str, str, str]]:
        return type(self), (self.element, self.rule, self.remedy, self.code)


class ModelError(Error):
    """The mechanism is impossible or incomplete."""


class ImportFileError(Error):
    """A file cannot be read as a mechanism."""


class SettingsError(Error):
    """A setting is out of its range, or does not apply to this model."""


class UsageError(Error, IndexError):
    """A plan or batch was asked for something that it does not hold, or was used by two threads at once."""
