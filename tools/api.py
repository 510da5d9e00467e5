"""Names and signatures of the public interface: python -m tools.api [--freeze].

Without an option: what differs from tests/api/public_api.txt. With --freeze the file is written again, provided that
acqd's version says what has changed (semver.org): a name or parameter that was removed or altered needs a new major
version (before 1.0: a new minor one), a new name a new minor version.
"""

from __future__ import annotations

import dataclasses
import inspect
import sys
from collections.abc import Callable
from pathlib import Path

import acqd

FROZEN = Path(__file__).parents[1] / "tests" / "api" / "public_api.txt"
_VERSION = "acqd "


def listing() -> list[str]:
    """One line per public name, and per public attribute of a class, in alphabetic order."""
    lines: list[str] = []
    for name in acqd.__all__:
        value = getattr(acqd, name)
        if inspect.ismodule(value):
            own = {key: one for key, one in vars(value).items() if getattr(one, "__module__", "") == value.__name__}
            shown = {key: one for key, one in own.items() if inspect.isfunction(one) and not key.startswith("_")}
            lines += [f"{name}.{key}{_signature(one)}" for key, one in sorted(shown.items())]
        elif inspect.isclass(value):
            lines += _of_class(name, value)
        elif callable(value):
            lines.append(f"{name}{_signature(value)}")
    return lines


def _signature(value: Callable[..., object]) -> str:
    """Without the quotation marks that versions of Python put differently."""
    return str(inspect.signature(value)).replace("'", "").replace('"', "")


def _of_class(name: str, value: type) -> list[str]:
    """The class: a dataclass by its fields, since users only read those; any other by its constructor."""
    if issubclass(value, Exception):
        return [f"class {name}({value.__mro__[1].__name__})"]
    fields = {each.name: each.type for each in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else {}
    lines = [f"class {name}" if fields else f"class {name}{_signature(value)}"]
    lines += [f"{name}.{field}: {kind}" for field, kind in sorted(fields.items())]
    for attribute in sorted(vars(value)):
        if attribute in fields or (attribute.startswith("_") and attribute != "__len__"):
            continue
        found = inspect.getattr_static(value, attribute)
        if isinstance(found, property):
            returned = inspect.signature(found.fget).return_annotation  # type: ignore[arg-type]
            lines.append(f"{name}.{attribute}: {returned}")
        elif callable(found) or isinstance(found, classmethod | staticmethod):
            lines.append(f"{name}.{attribute}{_signature(getattr(value, attribute))}")
    return lines


def frozen() -> tuple[str, list[str]]:
    """The version that was frozen, and its lines."""
    first, *lines = FROZEN.read_text(encoding="utf-8").splitlines()
    return first.removeprefix(_VERSION), lines


def too_low(before: str, now: str, removed: bool, added: bool) -> str | None:
    """Why the version `now` does not say what has changed since `before`; None if it does."""
    old, new = ([int(part) for part in text.split(".")] for text in (before, now))
    compatible_digits = 1 if old[0] else 2
    if removed and new[:compatible_digits] <= old[:compatible_digits]:
        return f"something was removed or altered: acqd {now} needs a higher {'major' if old[0] else 'minor'} version"
    if added and new[:2] <= old[:2]:
        return f"something was added: acqd {now} needs a higher minor version"
    return None


def main() -> int:
    """Print the differences, or freeze."""
    now = listing()
    before, lines = frozen() if FROZEN.exists() else ("0.0.0", [])
    removed, added = sorted(set(lines) - set(now)), sorted(set(now) - set(lines))
    print("\n".join([*(f"- {line}" for line in removed), *(f"+ {line}" for line in added)]) or "nothing has changed")
    if "--freeze" not in sys.argv:
        return int(bool(removed or added))
    reason = too_low(before, acqd.__version__, bool(removed), bool(added))
    if reason is not None:
        print(reason, file=sys.stderr)
        return 1
    FROZEN.write_text("\n".join([f"{_VERSION}{acqd.__version__}", *now, ""]), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
