"""Our observation folder: `meta.json`, `observations.jsonl`, and perhaps `edges.jsonl`, `clusters.jsonl`, images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from erag.core.errors import InputError
from erag.core.types import Interval
from erag.data import jsontext, structure
from erag.data.files import place, read_optional, read_text, source_name
from erag.data.jsontext import JsonObject
from erag.data.meta import interval_of, read_meta
from erag.data.reading import Reading
from erag.data.rows import CLUSTER_OUT, EDGE_OUT, ROW_OUT, IssueLog, RawCluster, RawEdge, RawRow, show
from erag.data.validation import Rules, observations

OBSERVATIONS, EDGES, CLUSTERS = "observations.jsonl", "edges.jsonl", "clusters.jsonl"
MAX_LINE = 16 * 1024 * 1024  # characters
_ROW_KEYS = frozenset({"id", "kind", "time", "pose", "image", "name", "caption", "sensors", "source"})
_EDGE_KEYS = frozenset({"a", "b", "kind", "metres"})
_CLUSTER_KEYS = frozenset({"id", "level", "members", "name", "summary", "relationships"})


class JsonlReader:
    """A folder with `observations.jsonl`, or one `.jsonl` file beside its `meta.json`."""

    kind = "jsonl"

    def sniff(self, path: Path) -> bool:
        return (path / OBSERVATIONS).is_file() if path.is_dir() else path.suffix.lower() in (".jsonl", ".ndjson")

    def read(self, path: Path) -> Reading:
        """Read the folder or file. Raises InputError if `meta.json` is missing or wrong, or no row is usable."""
        whole = path.is_dir() or path.name == OBSERVATIONS
        folder = path if path.is_dir() else path.parent
        rows = folder / OBSERVATIONS if whole else path
        if not rows.is_file():
            raise InputError(f"there is no {OBSERVATIONS} in it", where=place(path))
        log = IssueLog(rows.name)
        meta = read_meta(folder, log.beside("meta.json"))
        source = meta.name or source_name(path)
        rules = Rules(meta.frame, folder, source, meta.sensors)
        kept = observations(_rows(read_text(rows, log, folder), log), rules, log)
        ids = {o.id for o in kept}
        edge_log, cluster_log = log.beside(EDGES), log.beside(CLUSTERS)
        edges = structure.edges(_edges(folder, edge_log), ids, edge_log) if whole else ()
        clusters = structure.clusters(_clusters(folder, cluster_log), ids, cluster_log) if whole else ()
        return Reading(
            source=source,
            root=folder,
            frame=meta.frame,
            observations=kept,
            edges=edges,
            clusters=clusters,
            sensors=meta.sensors,
            issues=tuple(log.issues),
            notes=meta.notes,
        )


def _lines(text: str, keys: frozenset[str], out: str, log: IssueLog) -> Iterator[tuple[int, JsonObject]]:
    """Line number and object of every line; lines that are none are reported, and unknown keys once each."""
    unknown: Counter[str] = Counter()
    first: dict[str, int] = {}
    for number, line in enumerate(_split(text), start=1):
        if not line or line.isspace():
            continue
        try:
            value = jsontext.loads(line) if len(line) <= MAX_LINE else None
        except ValueError as error:
            log.add(number, f"not JSON: {error}", out)
            continue
        if not isinstance(value, JsonObject) or (key := jsontext.repeated(value)):
            long = f"a line of {len(line):,} characters, more than {MAX_LINE:,}" if len(line) > MAX_LINE else None
            what = long or ("the line is no JSON object" if not isinstance(value, JsonObject) else f"{show(key)} twice")
            log.add(number, what, out)
            continue
        for key in value.keys() - keys:
            unknown[key] += 1
            first.setdefault(key, number)
        yield number, value
    for key in sorted(unknown):
        log.add(first[key], f"unknown key {show(key)}, in {unknown[key]} lines", "ignored")


def _split(text: str) -> Iterable[str]:
    """Lines that end at `\\n` alone: JSON strings may hold the other separators that Python knows."""
    begin = 0
    while (end := text.find("\n", begin)) >= 0:
        yield text[begin:end]
        begin = end + 1
    yield text[begin:]


def _rows(text: str, log: IssueLog) -> Iterator[RawRow]:
    for line, row in _lines(text, _ROW_KEYS, ROW_OUT, log):
        pose = row.get("pose")
        at = pose if isinstance(pose, dict) else {}
        yield RawRow(
            line=line,
            id=row.get("id"),
            kind=row.get("kind", "place"),
            x=at.get("x"),
            y=at.get("y"),
            z=at.get("z", 0.0),
            yaw=at.get("yaw"),
            time=_time(row.get("time"), line, log),
            image=row.get("image"),
            name=row.get("name"),
            caption=row.get("caption"),
            sensors=row.get("sensors"),
            source=row.get("source"),
        )


def _time(value: object, line: int, log: IssueLog) -> Interval | str | None:
    """A stamp as it is, or `{"start", "end"}`; a bare number has no unit and is no time."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, dict):
        return interval_of(value.get("start"), value.get("end"), line, log)
    log.add(line, f"the time is {show(value)}, neither a stamp nor start and end", "kept without time")
    return None


def _edges(folder: Path, log: IssueLog) -> Iterator[RawEdge]:
    for line, edge in _lines(read_optional(folder / EDGES, log, folder), _EDGE_KEYS, EDGE_OUT, log):
        yield RawEdge(line, edge.get("a"), edge.get("b"), edge.get("kind"), edge.get("metres"))


def _clusters(folder: Path, log: IssueLog) -> Iterator[RawCluster]:
    for line, cluster in _lines(read_optional(folder / CLUSTERS, log, folder), _CLUSTER_KEYS, CLUSTER_OUT, log):
        members, said = cluster.get("members", []), cluster.get("relationships", [])
        if not isinstance(members, list) or not isinstance(said, list):
            log.add(line, f"members and relationships of {show(cluster.get('id'))} must be lists", CLUSTER_OUT)
            continue
        made = (cluster.get("id"), cluster.get("level"), tuple(members), cluster.get("name"), cluster.get("summary"))
        yield RawCluster(line, *made, tuple(said))
