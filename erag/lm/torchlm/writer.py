"""Writers turn a model's choices into an answer: free text, or JSON whose skeleton the code writes itself."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from erag.core.errors import BadModelOutput
from erag.lm.torchlm.lexicon import Lexicon
from erag.lm.torchlm.plan import common
from erag.lm.torchlm.schema import MAX_DIGITS, AnyOf, Fields, Items, Node, Number, Options, Text, openers

if TYPE_CHECKING:
    import torch

_STOPS = ",]}"  # what a model writes after a value; the code writes it anyway
_FRACTION = 6  # digits after the point


class Writer(Protocol):
    """An answer in the making."""

    queue: deque[int]  # tokens to be fed before the model chooses again
    tokens: list[int]  # of the answer so far, those of the queue included
    finished: bool
    truncated: bool  # the cap on tokens ended it
    cut: int  # strings of a schema that were ended by their maxLength or by the cap

    def choose(self, best: int, logits: torch.Tensor) -> None:
        """Go on by the model's choice: `best` is the likeliest token of logits (v,)."""
        ...


class FreeWriter:
    """Text up to the first token of `ends`, at most `most` tokens."""

    def __init__(self, ends: frozenset[int], most: int) -> None:
        self._ends, self._most = ends, most
        self.queue: deque[int] = deque()
        self.tokens: list[int] = []
        self.finished = self.truncated = most < 1
        self.cut = 0

    def choose(self, best: int, logits: torch.Tensor) -> None:
        del logits
        if best in self._ends:
            self.finished = True
            return
        self.tokens.append(best)
        self.queue.append(best)
        self.finished = self.truncated = len(self.tokens) >= self._most


@dataclass(frozen=True, slots=True)
class _Ask:
    """A choice left to the model: whether a token is allowed, and all that are (v,)."""

    allows: Callable[[int], bool]
    mask: Callable[[], torch.Tensor]


_Steps = Generator[_Ask, int, None]


class JsonWriter:
    """JSON of a schema, whatever the model chooses.

    The code writes keys and punctuation; the model writes what is inside strings and numbers, chooses among options and
    decides when an array ends. From `most` tokens on, whatever is open is closed as early as the schema allows.
    """

    def __init__(self, node: Node, lexicon: Lexicon, most: int) -> None:
        self._lexicon, self._most = lexicon, most
        self.queue: deque[int] = deque()
        self.tokens: list[int] = []
        self.finished = self.truncated = False
        self.cut = 0
        self._said = ""  # by the code, not yet among the tokens
        self._hint = ""  # what the model began to write after a string
        self._steps = self._value(node)
        self._ask: _Ask | None = None
        self._go_on(None)

    def choose(self, best: int, logits: torch.Tensor) -> None:
        """Raises BadModelOutput when no token of the vocabulary fits."""
        if self._ask is None:
            raise BadModelOutput("a finished answer was asked to go on")
        token = best
        if not self._ask.allows(best):
            masked = logits.float().masked_fill(~self._ask.mask(), float("-inf"))
            token = int(masked.argmax())
            if masked[token] == float("-inf"):
                raise BadModelOutput("no token of the vocabulary fits the schema", allowed="a vocabulary of all bytes")
        self._go_on(token)

    def _go_on(self, token: int | None) -> None:
        try:
            self._ask = next(self._steps) if token is None else self._steps.send(token)
        except StopIteration:
            self._flush()
            self._ask, self.finished = None, True
        else:
            self._flush()

    def _say(self, text: str) -> None:
        self._said += text

    def _flush(self) -> None:
        tokens = self._lexicon.vocabulary.encode(self._said) if self._said else []
        self._said = ""
        self.queue.extend(tokens)
        self.tokens.extend(tokens)

    def _take(self, token: int) -> None:
        self.queue.append(token)
        self.tokens.append(token)

    def _spent(self) -> bool:
        """Whether the cap is reached; the answer then counts as truncated."""
        spent = len(self.tokens) >= self._most
        self.truncated |= spent
        return spent

    def _value(self, node: Node) -> _Steps:
        self._hint = ""
        if isinstance(node, Text):
            yield from self._text(node)
        elif isinstance(node, Options):
            yield from self._options(node.values)
        elif isinstance(node, Number):
            yield from self._number(node)
        elif isinstance(node, Items):
            yield from self._items(node)
        elif isinstance(node, AnyOf):
            yield from self._any(node)
        else:
            yield from self._fields(node)

    def _fields(self, node: Fields) -> _Steps:
        self._say("{")
        for i, (key, value) in enumerate(node.fields):
            self._say(f"{', ' if i else ''}{key}: ")
            yield from self._value(value)
        self._say("}")

    def _items(self, node: Items) -> _Steps:
        self._say("[")
        for count in range(node.high):
            if count >= node.low:
                if self._spent():
                    break
                more = "," if count else "".join(openers(node.item))
                if self._hint not in ("]", ","):
                    self._hint = self._leads(more, (yield self._lead(more + "]")))
                if self._hint == "]":
                    break
            self._say(", " if count else "")
            yield from self._value(node.item)
        self._say("]")
        self._hint = ""

    def _text(self, node: Text) -> _Steps:
        self._say('"')
        count, open_ = 0, True
        while open_ and count < node.high and (count < node.low or not self._spent()):
            token = yield self._inside(node.high - count, node.low - count)
            if token in self._lexicon.closers:
                closer = self._lexicon.closers[token]
                self._say(closer.content)
                self._hint, open_ = closer.hint, False
                continue
            self._take(token)
            count += int(self._lexicon.characters[token])
            if token in self._lexicon.begun:
                count += yield from self._rest_of_character(self._lexicon.begun[token][1], node.high - count)
        self.cut += open_
        self._say('"')

    def _rest_of_character(self, begun: bytes, room: int) -> Generator[_Ask, int, int]:
        """Finish a character; the characters that were written beyond it."""
        more = 0
        while begun:
            ways = self._lexicon.going_on(begun, room)
            token = yield self._among(frozenset(ways))
            self._take(token)
            begun, more = ways[token]
        return more

    def _options(self, values: tuple[str, ...]) -> _Steps:
        """One of the values, chosen byte by byte where no token holds the character in which they differ."""
        agreed = values[0][: common(values)]
        done, left = agreed.encode(), [value.encode() for value in values]
        self._say(agreed)
        while len(left) > 1 or _within_character(left[0], len(done)):
            fits = {t: i for t in _prefixes(left, len(done)) if (i := self._lexicon.parts.get(t)) is not None}
            stops = self._lexicon.leading(_STOPS) if done in left else frozenset()
            token = yield self._among(frozenset(fits.values()) | stops)
            if token in stops:
                left = [done]
                break
            self._take(token)
            done += self._lexicon.vocabulary.bytes_of(token)
            left = [value for value in left if value.startswith(done)]
        self._say(left[0][len(done) :].decode())

    def _number(self, node: Number) -> _Steps:
        done = ""
        while True:
            fits = {
                c: self._lexicon.ids[c] for c in "-0123456789." if c in self._lexicon.ids and _begins(node, done + c)
            }
            whole = _is_number(node, done)
            if not fits or (whole and self._spent()):
                return
            stops = self._lexicon.leading(_STOPS) if whole else frozenset()
            token = yield self._among(frozenset(fits.values()) | stops)
            if token in stops:
                return
            self._take(token)
            done += self._lexicon.texts[token] or ""

    def _any(self, node: AnyOf) -> _Steps:
        token = yield self._lead("".join(sorted(openers(node))))
        lead = (self._lexicon.texts[token] or "").lstrip()[:1]
        yield from self._value(next(option for option in node.options if lead in openers(option)))

    def _inside(self, room: int, lacking: int) -> _Ask:
        """Inside a string that has room for so many characters and lacks so many."""
        words = self._lexicon

        def allows(token: int) -> bool:
            if token in words.closers:
                return lacking <= words.closers[token].characters <= room
            return 1 <= int(words.characters[token]) <= room

        def mask() -> torch.Tensor:
            ends = (words.closing >= max(lacking, 0)) & (words.closing <= room)
            return ((words.characters >= 1) & (words.characters <= room)) | ends

        return _Ask(allows, mask)

    def _lead(self, characters: str) -> _Ask:
        return self._among(self._lexicon.leading(characters))

    def _leads(self, more: str, token: int) -> str:
        """ "," when the token begins with one of `more`, else "]"."""
        return "," if token in self._lexicon.leading(more) else "]"

    def _among(self, tokens: frozenset[int]) -> _Ask:
        import torch

        def mask() -> torch.Tensor:
            allowed = torch.zeros(len(self._lexicon.texts), dtype=torch.bool)
            allowed[list(tokens)] = True
            return allowed

        return _Ask(tokens.__contains__, mask)


def _within_character(text: bytes, at: int) -> bool:
    """Whether a cut of UTF-8 at this byte would part a character."""
    return at < len(text) and 0x80 <= text[at] < 0xC0


def _prefixes(values: list[bytes], start: int) -> set[bytes]:
    """What may come next of values that agree up to `start`."""
    return {value[start:end] for value in values for end in range(start + 1, len(value) + 1)}


def _is_number(node: Number, text: str) -> bool:
    if not text or text[-1] in "-.":
        return False
    return node.fraction or (node.low is not None and node.high is not None and node.low <= int(text) <= node.high)


def _begins(node: Number, text: str) -> bool:
    """Whether some allowed number begins with this text."""
    minus, (whole, point, fraction) = text.startswith("-"), text.removeprefix("-").partition(".")
    if not set(whole + fraction) <= set("0123456789") or (len(whole) > 1 and whole[0] == "0") or (point and not whole):
        return False
    if node.fraction:
        return len(whole) <= MAX_DIGITS and len(fraction) <= _FRACTION
    if point or node.low is None or node.high is None:
        return False
    low, high = (-node.high, -node.low) if minus else (node.low, node.high)
    if minus and whole in ("", "0"):
        return whole == "" and high > 0  # a minus sign alone; -0 is 0
    lengths = range(1 if whole == "0" else MAX_DIGITS - len(whole) + 1)
    return any(int(whole) * 10**n <= high and int(whole) * 10**n + 10**n - 1 >= low for n in lengths)
