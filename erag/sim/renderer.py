"""Draws solids with pybullet's software renderer: no display, no OpenGL; the mask says exactly what is seen."""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from PIL import Image

from erag.sim import lettering
from erag.sim.camera import FAR, FIELD_OF_VIEW, NEAR, Camera, Frame, Size
from erag.sim.extra import require
from erag.sim.materials import materials
from erag.sim.model import Part, Picture
from erag.sim.textures import texture

OVERSAMPLING = 2  # rendered pixels a pixel's side


@dataclass(frozen=True, slots=True)
class Solid:
    """Parts that stand together at (x, y, z) metres, turned by `yaw` degrees."""

    parts: tuple[Part, ...]
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class Lamp:
    """The light of a scene: where it comes from, and how strong its parts are."""

    direction: tuple[float, float, float] = (4.0, 3.0, 8.0)
    ambient: float = 0.55
    diffuse: float = 0.55


class Renderer:
    """A pybullet client of its own; `load` shows solids, `draw` looks at them. Use it in a `with` block.

    Raises ConfigError where pybullet is not installed.
    """

    def __init__(self) -> None:
        self._bullet = _pybullet()
        self._folder = tempfile.TemporaryDirectory(prefix="erag-sim-")
        self._client: int = self._bullet.connect(self._bullet.DIRECT)
        self._textures: dict[str | Picture, int] = {}
        self._files: dict[str | Picture, Path] = {}
        self._names: tuple[str, ...] = tuple(materials())
        self._rows = {name: row for row, name in enumerate(self._names)}
        self._solid = np.empty(0, np.int32)  # body -> row of its solid
        self._material = np.empty(0, np.int32)  # body -> row of its material

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bullet.disconnect(physicsClientId=self._client)
        self._folder.cleanup()

    def load(self, solids: Sequence[Solid], rows: Iterable[int]) -> None:
        """Show the solids of these rows, and nothing else."""
        self._bullet.resetSimulation(physicsClientId=self._client)
        self._textures.clear()
        owners: list[tuple[int, int]] = []
        for row in rows:
            for part in solids[row].parts:
                self._add(solids[row], part)
                owners.append((row, self._rows[part.material]))
        table = np.array(owners, np.int32).reshape(-1, 2)
        self._solid, self._material = table[:, 0], table[:, 1]

    def draw(self, camera: Camera, size: Size, lamp: Lamp) -> Frame:
        """What `camera` sees."""
        b, w, h = self._bullet, size.width * OVERSAMPLING, size.height * OVERSAMPLING
        eye = np.array((camera.x, camera.y, camera.z))
        view = b.computeViewMatrix(eye.tolist(), (eye + camera.forward).tolist(), [0, 0, 1])
        projection = b.computeProjectionMatrixFOV(FIELD_OF_VIEW, w / h, NEAR, FAR)
        seen = b.getCameraImage(
            w, h, view, projection, renderer=b.ER_TINY_RENDERER, shadow=0, lightDirection=lamp.direction,
            lightAmbientCoeff=lamp.ambient, lightDiffuseCoeff=lamp.diffuse, lightSpecularCoeff=0.0,
            physicsClientId=self._client,
        )  # fmt: skip
        rgb = np.reshape(np.asarray(seen[2], np.float32), (h, w, 4))[..., :3]
        buffer = np.reshape(np.asarray(seen[3], np.float64), (h, w))[::OVERSAMPLING, ::OVERSAMPLING]
        body = np.reshape(np.asarray(seen[4], np.int64), (h, w))[::OVERSAMPLING, ::OVERSAMPLING]
        depth = FAR * NEAR / (FAR - (FAR - NEAR) * np.clip(buffer, 0, 1))
        known = (body >= 0) & (body < len(self._solid))
        inside = np.where(known, body, 0)
        solid = np.where(known, self._solid[inside], -1).astype(np.int32)
        material = np.where(known, self._material[inside], -1).astype(np.int32)
        shape = (size.height, OVERSAMPLING, size.width, OVERSAMPLING, 3)
        smooth = rgb.reshape(shape).mean((1, 3))
        return Frame(smooth.astype(np.uint8), depth.astype(np.float32), solid, material, self._names)

    def _add(self, solid: Solid, part: Part) -> None:
        b, mesh = self._bullet, part.mesh
        scale = 1.0 if part.picture is not None else materials()[part.material].scale
        shape = b.createVisualShape(
            b.GEOM_MESH, vertices=mesh.vertices.tolist(), indices=mesh.faces.ravel().tolist(),
            normals=mesh.normals.tolist(), uvs=(mesh.uvs / scale).tolist(), rgbaColor=[*part.tint, 1.0],
            specularColor=[0, 0, 0], physicsClientId=self._client,
        )  # fmt: skip
        turn = math.radians(solid.yaw) / 2
        body = b.createMultiBody(
            0, -1, shape, [solid.x, solid.y, solid.z], [0, 0, math.sin(turn), math.cos(turn)],
            physicsClientId=self._client,
        )  # fmt: skip
        look = part.picture if part.picture is not None else part.material
        b.changeVisualShape(body, -1, textureUniqueId=self._texture(look), physicsClientId=self._client)

    def _texture(self, look: str | Picture) -> int:
        if look not in self._textures:
            path = str(self._file(look))
            self._textures[look] = self._bullet.loadTexture(path, physicsClientId=self._client)
        return self._textures[look]

    def _file(self, look: str | Picture) -> Path:
        if look not in self._files:
            path = Path(self._folder.name) / f"{len(self._files)}.png"
            _image(look).save(path)
            self._files[look] = path
        return self._files[look]


def _image(look: str | Picture) -> Image.Image:
    if isinstance(look, Picture):
        return lettering.draw(look)
    m = materials()[look]
    first, second = (tuple(v / 255 for v in colour) for colour in (m.first, m.second))
    seed = int.from_bytes(look.encode(), "big") % 2**32
    return Image.fromarray(texture(m.texture, (first[0], first[1], first[2]), (second[0], second[1], second[2]), seed))


def _pybullet() -> Any:
    """The module; the line it prints on stderr when it is imported goes nowhere."""
    require()
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        import pybullet
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
    return pybullet
