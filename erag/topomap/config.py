"""How the edges of a map are made."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Metres = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class MapConfig(BaseModel):
    """The edge rules of `build_map`; a source's own edges are always kept.

    `path` says where path edges come from: `given`, only from the sources; `auto`, also by sequence for sources that
    state no traversable edge and whose places bear strictly increasing instants; `sequence`, by sequence for every
    source, in the order of its records. By sequence means that consecutive places are joined unless they are more than
    `max_path_step` metres apart.

    `edge_radius` joins places at most so many metres apart; `auto` does so only around sources without traversable
    edges, with a radius of 1.5 times the 95th percentile of their nearest-neighbour distances; None never does.

    `meet` joins recordings where they meet: a place and the nearest one of another component, at most so many metres
    apart, since a robot that has been at both has been at one spot; None never does.

    `bridge` joins the components left over by the shortest edges that connect them (a Euclidean minimum spanning tree
    over components), leaving out those longer than `max_bridge` metres (None: no limit); `auto` does so only for maps
    without path edges and without any traversable edge stated by a source.

    `observed_from` ties every object that has no edge to the nearest place.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: Literal["given", "sequence", "auto"] = "auto"
    max_path_step: Metres = 100.0
    edge_radius: Metres | Literal["auto"] | None = "auto"
    meet: Metres | None = 0.5
    bridge: Literal["auto"] | bool = "auto"
    max_bridge: Metres | None = 500.0
    observed_from: bool = True
