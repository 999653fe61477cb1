"""Sensor wishes in words: which channel of a map a text names, and which end of it is wished for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

import yaml
from pydantic import BaseModel, ConfigDict, Field

from erag.core.types import SensorWish

_NUMBER = r"(-?\d+(?:\.\d+)?)"
_UP = (
    r"high|higher|highest|good|best|rich|richest|strong|strongest|plenty of|lots of|much|great|healthy|green|greenest|"
    r"dense|densest"
)
_DOWN = (
    r"low|lower|lowest|poor|poorer|poorest|bad|worst|weak|weakest|little|scarce|sparse|sparsest|dry|driest|patchy|worn|dead|"
    r"brown|yellow|unhealthy"
)
_BETWEEN = r"(?: of| in| level| levels| reading| readings| value| values| quality| index| is| are)*"


class ChannelWords(BaseModel):
    """How a channel is spoken of: its `names`, words for its `high` and its `low` end, and what it is `about`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    about: str = ""
    names: tuple[str, ...] = ()
    high: tuple[str, ...] = ()
    low: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Wished:
    """A wish for a channel, and the words it was read from."""

    channel: str
    wish: SensorWish
    words: str


class Lexicon(BaseModel):
    """The words of all channels, by channel."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    channels: Mapping[str, ChannelWords] = Field(default_factory=dict)

    def of(self, channel: str) -> ChannelWords:
        """The words of a channel; one that nobody described is called by its own name."""
        known = self.channels.get(channel) or self.channels.get(channel.lower().replace("-", "_"))
        spoken = channel.lower().replace("_", " ")
        if known is None:
            return ChannelWords(about=spoken, names=(spoken,))
        return known.model_copy(update={"names": tuple(dict.fromkeys((spoken, *known.names)))})

    def about(self, channel: str) -> str:
        """What a channel measures, for people."""
        return self.of(channel).about or channel


@cache
def shipped() -> Lexicon:
    """The words that come with the package."""
    text = (resources.files("erag.aware") / "words" / "channels.yaml").read_text("utf-8")
    return Lexicon(channels={name: ChannelWords(**raw) for name, raw in yaml.safe_load(text).items()})


def lexicon(added: Mapping[str, ChannelWords]) -> Lexicon:
    """The shipped words, with those `added`: of a channel known already the lists are joined."""
    channels = dict(shipped().channels)
    for name, more in added.items():
        channels[name] = _joined(channels[name], more) if name in channels else more
    return Lexicon(channels=channels)


def _joined(known: ChannelWords, more: ChannelWords) -> ChannelWords:
    return ChannelWords(
        about=more.about or known.about,
        names=(*known.names, *more.names),
        high=(*known.high, *more.high),
        low=(*known.low, *more.low),
    )


def wishes(text: str, channels: Iterable[str], words: Lexicon) -> tuple[Wished, ...]:
    """The wishes a text makes of the `channels` a map has readings of, at most one a channel."""
    spoken = " ".join(text.lower().split())
    found = (_wished(spoken, channel, words.of(channel)) for channel in channels)
    return tuple(wish for wish in found if wish is not None)


def named(text: str, channels: Iterable[str], words: Lexicon) -> tuple[str, ...]:
    """The channels that a text speaks of, by a name or by a wish."""
    spoken = " ".join(text.lower().split())
    return tuple(c for c in channels if _any_of(words.of(c).names, spoken) or _wished(spoken, c, words.of(c)))


def unread(text: str, channels: Iterable[str], words: Lexicon) -> tuple[str, ...]:
    """Channels a text names outright that the map has no readings of, such as NDVI on a map of images alone."""
    spoken, known = " ".join(text.lower().split()), {c.lower() for c in channels}
    missing = (
        c for c in words.channels if c not in known and re.search(rf"\b{re.escape(c.replace('_', ' '))}\b", spoken)
    )
    return tuple(missing)


def _wished(spoken: str, channel: str, words: ChannelWords) -> Wished | None:
    names = _alternatives(words.names)
    return _ranged(spoken, channel, names) or _ended(spoken, channel, names, words)


def _ranged(spoken: str, channel: str, names: str) -> Wished | None:
    """`NDVI between 0.2 and 0.4`, `temperature above 20`, `noise below 40`."""
    if m := re.search(rf"\b(?:{names})\b{_BETWEEN} (?:between|from) {_NUMBER} (?:and|to) {_NUMBER}", spoken):
        low, high = sorted((float(m[1]), float(m[2])))
        return Wished(channel, (low, high), m[0])
    above = r"(?:above|over|more than|greater than|at least|higher than|>=?)"
    below = r"(?:below|under|less than|lower than|at most|<=?)"
    if m := re.search(rf"\b(?:{names})\b{_BETWEEN} {above} {_NUMBER}", spoken):
        return Wished(channel, (float(m[1]), _FAR), m[0])
    if m := re.search(rf"\b(?:{names})\b{_BETWEEN} {below} {_NUMBER}", spoken):
        return Wished(channel, (-_FAR, float(m[1])), m[0])
    return None


_FAR = 1e9  # stands for no bound: no sensor reads as much


def _ended(spoken: str, channel: str, names: str, words: ChannelWords) -> Wished | None:
    """`lush`, `low NDVI`, `where the grass is poor`: the end that stands first in the text, a denied one turned."""
    found = []
    for wish, own, degrees in (("high", words.high, _UP), ("low", words.low, _DOWN)):
        near = rf"\b(?:{degrees})\b{_BETWEEN} (?:{names})\b|\b(?:{names})\b{_BETWEEN}(?: most| very)? (?:{degrees})\b"
        for pattern in (rf"\b(?:{_alternatives(own)})\b" if own else None, near):
            if pattern and (m := re.search(pattern, spoken)):
                found.append((m.start(), wish, m[0]))
    if not found:
        return None
    start, wish, said = min(found)
    if re.search(r"\b(?:not|no|isn't|never|without|less)(?: \w+)? $", spoken[:start]):
        wish = "low" if wish == "high" else "high"
    return Wished(channel, "low" if wish == "low" else "high", said)


def _alternatives(phrases: Iterable[str]) -> str:
    return "|".join(re.escape(p) for p in sorted(phrases, key=lambda p: (-len(p), p)))


def _any_of(phrases: Iterable[str], spoken: str) -> bool:
    return re.search(rf"\b(?:{_alternatives(phrases)})\b", spoken) is not None
