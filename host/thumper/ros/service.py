"""A service: a query with typed request and reply, checked on both sides of the bus."""

import types
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import (
    Annotated,
    Any,
    Generic,
    Protocol,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from thumper.common.errors import ThumperError

RequestT = TypeVar("RequestT")
ReplyT = TypeVar("ReplyT")

_TYPE_NAMES = {float: "a number", int: "an integer", str: "a string"}


class QueryClient(Protocol):
    """The part of a bus client that services need."""

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Query the robot and return its answer; raises ThumperError if it refuses or does not answer."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Service(Generic[RequestT, ReplyT]):
    """One query. The texts in `Annotated` fields of its types describe them in docs/reference/bus.md."""

    name: str
    summary: str  # what it does, for docs/reference/bus.md
    request: type[RequestT] | None  # None: the JSON object has other keys than fields, see `request_doc`
    request_doc: str = ""
    reply: type[ReplyT]

    def check(self, content: Mapping[str, Any]) -> None:
        """Check the JSON object of a request; raises ValueError for a wrong field."""
        if self.request is not None:
            _check_fields(self.request, content)

    def parse(self, content: Mapping[str, Any]) -> RequestT:
        """Convert the JSON object of a request; raises ThumperError for a wrong field."""
        if self.request is None:
            return cast("RequestT", content)
        try:
            self.check(content)
        except ValueError as error:
            raise ThumperError(f"{self.name}: {error}") from None
        hints = get_type_hints(self.request)
        numbers = {name for name in content if _json_type(hints[name]) is float}
        return self.request(
            **{name: float(value) if name in numbers else value for name, value in content.items()}
        )

    def call(self, client: QueryClient, request: RequestT | None = None, *, source: str = "") -> ReplyT:
        """Call the service; raises ThumperError if the robot refuses or does not answer."""
        return self.read_reply(client.query(self.name, request_content(request), source=source))

    def read_reply(self, answer: Mapping[str, Any]) -> ReplyT:
        """Convert the JSON object of an answer; raises ThumperError if a field is missing."""
        names = [field.name for field in fields(self.reply)]  # type: ignore[arg-type]  # all are dataclasses
        if missing := [name for name in names if name not in answer]:
            raise ThumperError(
                f"the robot's answer to {self.name} has no {missing[0]!r}; is it another version?"
            )
        return self.reply(**{name: answer[name] for name in names})

    def row(self) -> list[str]:
        """Return the cells of its row in docs/reference/bus.md: name, summary, request, reply."""
        request = self.request_doc if self.request is None else _described(self.request)
        return [f"`{self.name}`", self.summary, request, _described(self.reply)]


def json_object(reply: object) -> dict[str, Any]:
    """Return the JSON object of a reply, which is a dataclass."""
    return {field.name: getattr(reply, field.name) for field in fields(reply)}  # type: ignore[arg-type]


def request_content(request: object) -> Mapping[str, Any]:
    """Return the JSON object of a request; optional fields that are None are left out."""
    if request is None or isinstance(request, Mapping):
        return request or {}
    return {name: value for name, value in json_object(request).items() if value is not None}


def _described(kind: type[Any]) -> str:
    """Return the fields of a request or reply: their names, and what their annotations say."""
    hints = get_type_hints(kind, include_extras=True)
    cells = []
    for field in fields(kind):
        text = f"`{field.name}`" if field.default is MISSING else f"`{field.name}`, optional"
        if get_origin(hints[field.name]) is Annotated:
            text += f" ({get_args(hints[field.name])[1]})"
        cells.append(text)
    return "; ".join(cells)


def _check_fields(request: type[Any], content: Mapping[str, Any]) -> None:
    hints = get_type_hints(request)
    for name, value in content.items():
        if name not in hints:
            raise ValueError(f"unknown field {name!r}; its fields: {', '.join(hints) or 'none'}")
        expected = _json_type(hints[name])
        accepted = (int, float) if expected is float else (expected,)
        if not isinstance(value, accepted) or (isinstance(value, bool) and expected is not bool):
            raise ValueError(f"{name}: expected {_TYPE_NAMES[expected]}, not {value!r}")
    for field in fields(request):
        if field.default is MISSING and field.name not in content:
            raise ValueError(f"missing field {field.name!r}")


def _json_type(hint: Any) -> type:
    """Return the JSON type of a field; an optional field is absent or of its type, never null."""
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (part for part in get_args(hint) if part is not type(None))
    return cast("type", hint)
