"""JSON objects read key by key: what is missing, of a wrong kind or left over is refused."""

from __future__ import annotations

from typing import Any, NoReturn, TypeVar, final

from workbench.errors import InputError
from workbench.runtime.contents import MANIFEST_FILE

_Value = TypeVar("_Value")


def refuse(where: str, what: str) -> NoReturn:
    """Raise InputError that names the key at fault."""
    place = f"{MANIFEST_FILE}: {where}" if where else MANIFEST_FILE
    raise InputError(f"{place}: {what}; rebuild the bundle with `workbench build`")


def no_constant(name: str) -> NoReturn:
    """Refuse NaN and infinities, which Python reads as JSON."""
    raise ValueError(f"{name} is not a JSON number")


def as_text(value: object, where: str) -> str:
    """The value, which must be a text."""
    if not isinstance(value, str):
        refuse(where, f"expected a text, got {value!r}")
    return value


def as_finite(value: object, where: str) -> float:
    """The value, which must be a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1.7e308:
        refuse(where, f"expected a finite number, got {value!r}")
    return float(value)


@final
class JsonReader:
    """One JSON object, read key by key; what is missing, of a wrong kind or left is refused."""

    def __init__(self, content: object, where: str) -> None:
        if not isinstance(content, dict):
            refuse(where, f"expected an object, got {type(content).__name__}")
        self.where = where
        self._content: dict[str, Any] = content
        self._left = dict.fromkeys(content)

    def _place(self, key: str) -> str:
        return f"{self.where}.{key}" if self.where else key

    def take(self, key: str, kind: Any) -> Any:
        """The value of a key, of the given kind or kinds."""
        if key not in self._content:
            refuse(self._place(key), "expected this key, it is missing")
        self._left.pop(key, None)
        value = self._content[key]
        if not isinstance(value, kind):
            refuse(self._place(key), f"expected {_kind_name(kind)}, got {value!r:.80}")
        return value

    def text(self, key: str) -> str:
        """A text."""
        value: str = self.take(key, str)
        return value

    def integer(self, key: str) -> int:
        """An integer."""
        value = self.take(key, int)
        if isinstance(value, bool):
            refuse(self._place(key), f"expected an integer, got {value!r}")
        return int(value)

    def number(self, key: str) -> float:
        """A finite number."""
        return as_finite(self.take(key, object), self._place(key))

    def items(self, key: str) -> list[Any]:
        """A list."""
        value: list[Any] = self.take(key, list)
        return value

    def part(self, key: str) -> JsonReader:
        """An object."""
        return JsonReader(self.take(key, dict), self._place(key))

    def optional_part(self, key: str) -> JsonReader | None:
        """An object that may be left out."""
        return self.part(key) if key in self._content else None

    def optional_text(self, key: str) -> str | None:
        """A text that may be left out."""
        return self.text(key) if key in self._content else None

    def numbers(self, key: str) -> tuple[float, ...]:
        """A list of finite numbers."""
        return tuple(as_finite(value, self._place(key)) for value in self.items(key))

    def interval(self, key: str) -> tuple[float, float]:
        """Two finite numbers; whether they are in order is the owner's to check."""
        numbers = self.numbers(key)
        if len(numbers) != 2:
            refuse(self._place(key), f"expected [lower, upper], got {numbers!r}")
        return numbers[0], numbers[1]

    def parts(self, key: str) -> list[JsonReader]:
        """A list of objects."""
        place = self._place(key)
        return [JsonReader(item, f"{place}[{index}]") for index, item in enumerate(self.items(key))]

    def left(self) -> list[str]:
        """Keys that were not read yet."""
        return list(self._left)

    def done(self, value: _Value) -> _Value:
        """The value made of this object, of which nothing must be left."""
        self.finish()
        return value

    def finish(self) -> None:
        """Refuse keys that were not read."""
        if self._left:
            refuse(self.where, f"unknown keys {self.left()}")


def _kind_name(kind: Any) -> str:
    names = {str: "a text", int: "an integer", list: "a list", dict: "an object"}
    return names.get(kind, "a list or null")
