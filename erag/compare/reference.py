"""What cloud models said of a source, as call records: captions, summaries and decisions to be held against ours."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from erag.core.text import clean, node_text
from erag.core.types import Observation
from erag.data.coex import said_and_listed
from erag.data.reading import GivenCluster, Reading
from erag.data.registry import read
from erag.lm.callfile import Record, Source
from erag.lm.images import BadImages, read_file
from erag.lm.journal import call_keys
from erag.lm.records import CODECS, request_text
from erag.lm.roles import Caption, Group, RoleName, Summary
from erag.study.decisions import chats_of, read_all

RULES = 1  # changes when other records would come out of the same source


@dataclass(frozen=True)
class References:
    """Records of one source, how many of each role, and what could not become one."""

    records: tuple[Record, ...]
    notes: tuple[str, ...]

    @property
    def counts(self) -> Mapping[str, int]:
        """Records by role."""
        return Counter(record.source.role for record in self.records)


def references(source: Path, teacher: str) -> References:
    """The records of a map with captions and a forest (any of our readers), or of a folder of decisions.

    A caption becomes a record where its image is there, a summary with the texts of its members as request (as in the
    paper). Raises InputError for a source that cannot be read.
    """
    chats = chats_of(source)
    if chats is not None:
        found = read_all([chats])
        made = (_record("select", teacher, source.name, d.task, [d.chosen], "k=1") for d in found.decisions)
        return References(tuple(made), found.notes)
    reading = read(source)
    notes: Counter[str] = Counter()
    captions = tuple(_captions(reading, teacher, notes))
    summaries = tuple(_summaries(reading, teacher, notes))
    return References((*captions, *summaries), tuple(f"{what}: {n:,}" for what, n in notes.items()))


def cloud_caption(observation: Observation) -> Caption:
    """A caption as it was said: the text, and the objects where they are listed."""
    return Caption(*said_and_listed(clean(observation.caption or "")))


def member_texts(clusters: tuple[GivenCluster, ...], observations: tuple[Observation, ...]) -> Mapping[str, str]:
    """What each node and each cluster says, by id: what a summariser of the level above was given."""
    said = {o.id: node_text(o.name, o.caption) for o in observations}
    return said | {c.id: ": ".join(filter(None, (clean(c.name), clean(c.summary)))) for c in clusters}


def _captions(reading: Reading, teacher: str, notes: Counter[str]) -> Iterator[Record]:
    for seen in reading.observations:
        if not seen.caption:
            continue
        if seen.image is None:
            notes["captions without an image, which are data but no records"] += 1
            continue
        try:
            request = sha256(read_file(reading.root / seen.image)).hexdigest()
        except BadImages:
            notes["captions whose image is not there, which are data but no records"] += 1
            continue
        yield _written("caption", teacher, reading.source, request, cloud_caption(seen))


def _summaries(reading: Reading, teacher: str, notes: Counter[str]) -> Iterator[Record]:
    said = member_texts(reading.clusters, reading.observations)
    for cluster in reading.clusters:
        texts = tuple(filter(None, (said.get(member, "") for member in cluster.members)))
        if not (cluster.summary and texts):
            notes["clusters without a summary, or without members that say anything"] += 1
            continue
        summary = Summary(clean(cluster.name), clean(cluster.summary), tuple(map(clean, cluster.relationships)))
        yield _record("summarise", teacher, reading.source, Group(texts), summary)


def _record(role: RoleName, teacher: str, source: str, request: object, result: object, parameters: str = "") -> Record:
    return _written(role, teacher, source, request_text(request), result, parameters)


def _written(role: RoleName, teacher: str, source: str, request: str, result: object, parameters: str = "") -> Record:
    stated = {"kind": "reference", "teacher": teacher, "source": source, "rules": RULES}
    made = Source(role, json.dumps(stated, sort_keys=True))
    (key,) = call_keys(role, made.fingerprint, [request], parameters)
    return Record(made, key, request, CODECS[role].encode(result))
