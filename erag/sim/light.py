"""Light, sky and weather: what turns a bare rendering into a morning in April or a misty evening."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, map_coordinates

from erag.sim.camera import Camera, Frame, Size, directions
from erag.sim.materials import materials
from erag.sim.renderer import Lamp
from erag.sim.scene import Light, Visit, Weather

Rgb = tuple[float, float, float]
_CLOUDS = (128, 512)  # rows of elevation, columns of azimuth


@dataclass(frozen=True, slots=True)
class Mood:
    """The light at one time of day: the lamp, the tint of all it falls on, and the sky from horizon to zenith."""

    lamp: Lamp
    tint: Rgb
    horizon: Rgb
    zenith: Rgb


MOODS: Mapping[Light, Mood] = {
    "morning": Mood(Lamp((7, 3, 6), 0.52, 0.55), (1.03, 0.99, 0.92), (0.93, 0.90, 0.84), (0.45, 0.65, 0.90)),
    "midday": Mood(Lamp((3, -2, 9), 0.56, 0.56), (1.03, 1.02, 1.0), (0.80, 0.89, 0.97), (0.28, 0.53, 0.88)),
    "overcast": Mood(Lamp((1, 1, 9), 0.68, 0.30), (0.90, 0.92, 0.95), (0.80, 0.82, 0.84), (0.66, 0.69, 0.73)),
    "evening": Mood(Lamp((-8, 2, 4), 0.48, 0.55), (1.06, 0.88, 0.72), (0.98, 0.72, 0.48), (0.42, 0.45, 0.68)),
    "night": Mood(Lamp((2, 3, 9), 0.60, 0.30), (0.42, 0.45, 0.60), (0.16, 0.18, 0.28), (0.04, 0.06, 0.14)),
    "indoor": Mood(Lamp((2.5, 4, 7), 0.70, 0.44), (1.0, 0.985, 0.95), (0.8, 0.85, 0.9), (0.5, 0.6, 0.8)),
}
# weather -> metres at which haze hides all but a third of the contrast, share of the sky under cloud
AIR: Mapping[Weather, tuple[float, float]] = {
    "clear": (600.0, 0.25),
    "cloudy": (400.0, 0.7),
    "misty": (38.0, 1.0),
    "snow": (160.0, 0.9),
}


def finished(frame: Frame, camera: Camera, size: Size, when: Visit) -> npt.NDArray[np.uint8]:
    """The picture (h, w, 3) that the camera takes of `frame` in the light and weather of a visit."""
    mood = MOODS[when.light]
    rgb = frame.rgb.astype(np.float64) / 255
    glow = np.isin(frame.material, [i for i, name in enumerate(frame.materials) if materials()[name].glow])
    tint = np.where(glow[..., None] & (when.light in ("night", "evening")), 1.12, np.array(mood.tint))
    lit = rgb * tint
    sky = _sky(camera, size, mood, when.weather)
    if when.light != "indoor":
        reach, _ = AIR[when.weather]
        haze = 1 - np.exp(-frame.depth.astype(np.float64) / reach)
        lit = lit * (1 - haze[..., None]) + np.array(mood.horizon) * haze[..., None]
    image = np.where(frame.sky[..., None], sky, lit)
    return np.asarray(np.clip(image * 255 + 0.5, 0, 255), np.uint8)


def _sky(camera: Camera, size: Size, mood: Mood, weather: Weather) -> npt.NDArray[np.float64]:
    azimuth, elevation = directions(camera, size)
    height = np.clip(elevation / 0.9, 0, 1)[..., None] ** 0.7
    plain = np.array(mood.horizon) * (1 - height) + np.array(mood.zenith) * height
    rows = np.clip(elevation / 1.6, 0, 1) * (_CLOUDS[0] - 1)
    columns = azimuth % (2 * np.pi) / (2 * np.pi) * _CLOUDS[1]
    cover = map_coordinates(_clouds(AIR[weather][1]), [rows, columns], order=1, mode="grid-wrap")[..., None]
    white = np.array(mood.horizon) * 0.55 + 0.45 * np.mean(mood.horizon)
    return np.asarray(plain * (1 - 0.85 * cover) + white * 0.85 * cover)


def _clouds(share: float) -> npt.NDArray[np.float64]:
    """Cloud cover 0..1 over elevation and azimuth, about `share` of it covered."""
    rng = np.random.default_rng(7)
    field = np.zeros(_CLOUDS)
    for sigma, weight in ((14, 14.0), (6, 3.0), (3, 0.75)):
        noise = rng.standard_normal(_CLOUDS)
        field += weight * gaussian_filter(noise, (sigma, 2.2 * sigma), mode=("nearest", "wrap"))
    low = float(np.quantile(field, 1 - share))
    return np.asarray(np.clip((field - low) / (float(field.std()) * 0.8 + 1e-9), 0, 1))
