"""Maps of the probes, rendered.

Five bakes, so that a method pays for what it reads: where the probes stand, the glossy radiance, all of the light, the
visible surface and the reflected one (Rodriguez et al. 2020, section 4.1). All probes share the passes: a lane is a
path through a texel of any probe.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from gibench.baselines.method import MAX_DEPTH, Setting, Site
from gibench.baselines.probes import placement
from gibench.baselines.probes.adaptive.parameterization import CELLS, GUIDE_MAPS, GUIDES, parameterize
from gibench.baselines.probes.adaptive.warp import Warp
from gibench.baselines.probes.errors import ProbeError
from gibench.baselines.probes.mappings import ADAPTIVE, MAPPINGS, LatLong, Octahedral
from gibench.baselines.probes.narrowed import NarrowedMaterials
from gibench.datasets.exr import fits_half
from gibench.rendering import surface
from gibench.rendering.denoise import denoise_part
from gibench.rendering.gbuffer import Hit
from gibench.rendering.integrator import scatter_paths
from gibench.rendering.replay import Replay
from gibench.rendering.sampling import IndependentSampler
from gibench.rendering.scene import Scene

LANES = 1 << 22
"""Paths in flight at once, so that memory does not grow with the probes."""

SEED = 0
"""Probes are part of the scene to all methods and seeds."""

POSITIONS, RADIANCE, LIGHT, VISIBLE, REFLECTED = "positions", "radiance", "light", "visible", "reflected"
FORWARD, INVERSE = "forward", "inverse"
"""Files of the bake `parameterization`."""

MAPS: dict[str, tuple[str, int, type]] = {
    "radiance": (RADIANCE, 3, np.float16),
    "light": (LIGHT, 3, np.float16),
    "distance": (VISIBLE, 1, np.float32),
    "normal": (VISIBLE, 3, np.float16),
    "roughness": (VISIBLE, 1, np.float16),
    "material_id": (VISIBLE, 1, np.uint16),
    "reflected_position": (REFLECTED, 3, np.float32),
    "reflected_material_id": (REFLECTED, 1, np.uint16),
}
"""Map → the bake it lies in, components and type on disk. Radiance and light become float32 where half cannot hold
them."""

MARGIN = 32
"""Texels beyond the edges of a map that its denoiser sees."""


@dataclass(frozen=True)
class ProbeSettings:
    """Settings of the probes of a scene.

    count: about how many (≥ 1). width: texels around (even). height: from top to bottom. spp: paths a texel.
    denoise: whether radiance goes through Open Image Denoise. mapping: a name in `MAPPINGS`. first_roughness: what
    GGX alpha is multiplied by where a path from the probe meets its first surface, in (0, 1].
    """

    count: int
    width: int
    height: int
    spp: int
    denoise: bool = False
    mapping: str = "lat-long"
    first_roughness: float = 1.0

    def __post_init__(self) -> None:
        """Raises ProbeError."""
        if self.mapping not in MAPPINGS:
            raise ProbeError(f"there is no mapping '{self.mapping}': choose from {', '.join(MAPPINGS)}")
        if self.width < 2 or self.width % 2 or self.height < 2 or self.height % 2:
            raise ProbeError(f"maps of {self.width} × {self.height} texels: both must be even and at least 2")
        if self.count < 1 or not 1 <= self.spp <= LANES:
            raise ProbeError(f"{self.count} probes of {self.spp} paths a texel: at least 1 of each is needed")
        if not 0 < self.first_roughness <= 1:
            raise ProbeError(f"first_roughness is {self.first_roughness}: it must be above 0, at most 1")

    @staticmethod
    def of(settings: Mapping[str, Setting]) -> ProbeSettings:
        """From a method's settings with the knobs of `knobs.PROBE_KNOBS`."""
        width = int(settings["probe_width"])
        return ProbeSettings(
            int(settings["probes"]),
            width,
            width // 2,
            int(settings["probe_spp"]),
            bool(settings["probe_denoise"]),
        )

    def octahedral(self, multiple: int) -> ProbeSettings:
        """The same on square octahedral maps of about as many texels, a multiple of `multiple` along a side."""
        side = multiple * max(round((self.width * self.height) ** 0.5 / multiple), 1)
        return replace(self, width=side, height=side, mapping="octahedral")


def _rays(positions, mapping, warp: Warp | None, lane, inside: Any):
    """Rays of lanes that count texels, all of a probe after all of another. inside: mi.Point2f, place in the texel."""
    texels = dr.opaque(mi.UInt32, mapping.width * mapping.height)
    width = dr.opaque(mi.UInt32, mapping.width)
    probe = lane // texels
    texel = lane - probe * texels
    row = texel // width
    at = mi.Point2f(mi.Float(texel - row * width), mi.Float(row)) + inside
    if warp is not None:
        at = warp.plain(probe, at)
    return mi.Ray3f(dr.gather(mi.Point3f, positions, probe), mapping.direction(at))


class _Baker:
    """Fills maps of all probes, pass by pass."""

    def __init__(
        self,
        scene: Scene,
        positions: NDArray[np.float32],
        settings: ProbeSettings,
        materials: NarrowedMaterials | None = None,
        warp: Warp | None = None,
        *,
        max_depth: int = MAX_DEPTH,
    ) -> None:
        """positions: (N, 3), metres.

        materials: of the first hits, where they are not the scene's own. warp: of adaptive probes. max_depth:
        scattering events of a path.
        """
        self.max_depth = max_depth
        self.scene, self.settings, self.count = scene, settings, len(positions)
        self.materials, self.warp = materials, warp
        self.held = [thing.arrays for thing in (materials, warp) if thing is not None]
        self.mapping = MAPPINGS[settings.mapping](settings.width, settings.height)
        self.positions = mi.Float(positions.ravel())
        dr.make_opaque(self.positions)

    def run(
        self, kernel: Callable[..., dict[str, Any]], samples: int, files: Mapping[str, NDArray[Any]]
    ) -> None:
        """Fill arrays (probes, height, width, components) by name from a kernel(first, seed, texels), pass by pass."""
        replay = Replay(self.scene, kernel, self.positions, self.held)
        flat = {name: array.reshape(-1, array.shape[-1]) for name, array in files.items()}
        total = len(next(iter(flat.values())))
        most = max(LANES // samples, 1)
        for number, first in enumerate(range(0, total, most)):
            count = min(most, total - first)
            seed = int(np.random.SeedSequence(SEED, spawn_key=(number,)).generate_state(1)[0])
            values = replay(dr.opaque(mi.UInt32, first), dr.opaque(mi.UInt32, seed), count)
            for name, value in values.items():
                parts = (
                    [np.array(part) for part in value]
                    if isinstance(value, (list, tuple))
                    else [np.array(value)]
                )
                flat[name][first : first + count] = np.stack(parts, axis=-1)

    def radiance(self, first, seed, texels: int) -> dict[str, Any]:
        """Glossy light alone."""
        return {"radiance": self._sums(first, seed, texels, "specular")}

    def light(self, first, seed, texels: int) -> dict[str, Any]:
        """All light, emission and environment included."""
        return {"light": self._sums(first, seed, texels, "all")}

    def _sums(self, first, seed, texels: int, lobes: str) -> list[Any]:
        spp = self.settings.spp
        sampler = IndependentSampler()
        sampler.independent.seed(seed, texels * spp)
        share = dr.rcp(dr.opaque(mi.Float, spp))
        lane = dr.arange(mi.UInt32, texels * spp) // dr.opaque(mi.UInt32, spp) + first
        ray = _rays(self.positions, self.mapping, self.warp, lane, sampler.next_2d())
        si = self.scene.mi_scene.ray_intersect(ray)
        narrowed = self.materials
        path = scatter_paths(
            self.scene.mi_scene,
            sampler,
            si,
            si.bsdf(ray) if narrowed is None else narrowed.at(si),
            mi.Bool(True),
            max_depth=self.max_depth,
            lobes=lobes,
            portals=self.scene.portals,
            layers=(self.scene if narrowed is None else narrowed).layers,
            guide=self.scene.guide,
        )
        value = path.direct_specular + path.indirect_specular
        if lobes == "all":
            value += path.direct_diffuse + path.indirect_diffuse
            value += si.emitter(self.scene.mi_scene).eval(si)
        value = dr.select(dr.all(dr.isfinite(value)), value * share, 0)
        dr.eval(value)
        sums = [dr.block_sum(part, spp) for part in value]
        dr.eval(sums)
        return sums

    def surfaces(self, names: tuple[str, ...]) -> Callable[..., dict[str, Any]]:
        """A kernel that samples these maps, and the two albedos, at the centres of texels."""

        def kernel(first, seed, texels: int) -> dict[str, Any]:
            lane = dr.arange(mi.UInt32, texels) + first
            ray = _rays(self.positions, self.mapping, self.warp, lane, mi.Point2f(0.5))
            hit = Hit(self.scene, ray, mi.RayFlags.All)
            mirror = hit.mirrored() if any(name.startswith("reflected") for name in names) else hit
            values: dict[str, Callable[[], Any]] = {
                "distance": lambda: hit.masked(hit.si.t),
                "normal": lambda: list(hit.normal),
                "roughness": lambda: surface.roughness(self.scene, hit.bsdf, hit.si, hit.valid),
                "material_id": lambda: self.scene.material_ids(hit.bsdf, hit.valid),
                "albedo": lambda: list(surface.albedo(self.scene, hit.bsdf, hit.si, hit.valid)),
                "specular_albedo": lambda: list(
                    surface.specular_albedo(self.scene, hit.bsdf, hit.si, hit.valid)
                ),
                "reflected_position": lambda: list(mirror.masked(mirror.si.p)),
                "reflected_material_id": lambda: self.scene.material_ids(mirror.bsdf, mirror.valid),
            }
            computed = {name: values[name]() for name in names}
            dr.eval(computed)
            return computed

        return kernel


def _new(folder: Path, name: str, shape: tuple[int, ...], dtype: type) -> NDArray[Any]:
    """A file of zeros that an array lies in, so that maps need not fit into memory."""
    path = folder / f"{name}.npy"
    array: NDArray[Any] = np.lib.format.open_memmap(path, mode="w+", dtype=dtype, shape=shape)
    return array


def _bake_surfaces(baker: _Baker, part: str, folder: Path) -> None:
    settings = baker.settings
    shape = (baker.count, settings.height, settings.width)
    chosen = {name: (size, dtype) for name, (where, size, dtype) in MAPS.items() if where == part}
    files = {name: _new(folder, name, (*shape, size), dtype) for name, (size, dtype) in chosen.items()}
    baker.run(baker.surfaces(tuple(files)), 1, files)
    for file in files.values():
        file.flush()  # type: ignore[attr-defined]


def _denoised(
    radiance: NDArray[np.float32], guides: Mapping[str, NDArray[np.float32]], mapping: LatLong | Octahedral
) -> NDArray[np.float32]:
    """One map (H, W, 3), denoised as if it went on beyond its edges, with the light of its samples kept."""
    height, width = radiance.shape[:2]
    margin = min(MARGIN, width, height)
    denoised = denoise_part(
        mapping.surrounded(radiance, margin),
        **{name: mapping.surrounded(guide, margin) for name, guide in guides.items()},
    )
    rows = (denoised.shape[0] - height) // 2
    return denoised[rows : rows + height, margin : margin + width]


def _bake_radiance(baker: _Baker, part: str, folder: Path) -> None:
    """The map `part`, RADIANCE or LIGHT, denoised by the albedo of what it reflects."""
    settings = baker.settings
    shape = (baker.count, settings.height, settings.width, 3)
    raw = _new(folder, "raw", shape, np.float32)
    kernels = {
        RADIANCE: (baker.radiance, ("specular_albedo",)),
        LIGHT: (baker.light, ("albedo", "specular_albedo")),
    }
    kernel, albedos = kernels[part]
    baker.run(kernel, settings.spp, {part: raw})
    if settings.denoise:
        guides = {name: np.zeros(shape, dtype=np.float32) for name in ("normal", *albedos)}
        baker.run(baker.surfaces(tuple(guides)), 1, guides)
        albedo = np.clip(sum(guides[name] for name in albedos), 0, 1)
        for k in range(len(raw)):
            guide = {"albedo": albedo[k], "normal": guides["normal"][k]}
            raw[k] = _denoised(np.asarray(raw[k]), guide, baker.mapping)
    # Radiance is compared with the mean of its map: what is far below it may lose digits.
    half = all(fits_half(np.asarray(one), dark=float(one.mean())) for one in raw)
    final = _new(folder, part, shape, np.float16 if half else np.float32)
    for k in range(len(raw)):
        final[k] = raw[k]
    final.flush()  # type: ignore[attr-defined]
    del raw
    (folder / "raw.npy").unlink()


def _bake_parameterization(
    scene: Scene, positions: NDArray[np.float32], size: tuple[int, int], folder: Path
) -> None:
    """size: (width, height) of the maps of the probes."""
    width, height = GUIDES
    baker = _Baker(scene, positions, ProbeSettings(len(positions), width, height, 1))
    shape = (len(positions), height, width)
    guides = {name: np.zeros((*shape, MAPS[name][1]), dtype=np.float32) for name in GUIDE_MAPS}
    baker.run(baker.surfaces(GUIDE_MAPS), 1, guides)
    row, column = np.indices((height, width), dtype=np.float32).reshape(2, -1) + 0.5
    towards = np.array(baker.mapping.direction(mi.Point2f(column, row))).T.reshape(height, width, 3)
    forward = _new(folder, FORWARD, (len(positions), CELLS[1] + 1, CELLS[0] + 1, 2), np.float32)
    inverse = _new(folder, INVERSE, (len(positions), size[1] + 1, size[0] + 1, 2), np.float32)
    for k in range(len(positions)):
        one = {name: guide[k] for name, guide in guides.items()}
        facing = np.abs((one["normal"] * towards).sum(axis=-1))
        forward[k], inverse[k] = parameterize(one, facing, size)
    for file in (forward, inverse):
        file.flush()  # type: ignore[attr-defined]


def load_warp(settings: ProbeSettings, files: Mapping[str, Path]) -> Warp | None:
    """Directions of the texels of probes, from `baked_files`; None where they are not adaptive."""
    if settings.mapping != ADAPTIVE:
        return None
    forward, inverse = (np.load(files[name]) for name in (FORWARD, INVERSE))
    return Warp((settings.width, settings.height), forward, inverse)


def _first_materials(site: Site, settings: ProbeSettings) -> NarrowedMaterials | None:
    if settings.first_roughness == 1:
        return None
    return NarrowedMaterials(site.scene, site.folder / "scene.xml", settings.first_roughness)


def baked_files(site: Site, settings: ProbeSettings, maps: tuple[str, ...]) -> dict[str, Path]:
    """Files by name of map, and "positions", baked where they are not there yet.

    maps: names in MAPS. Raises ProbeError, DenoiserError.
    """
    placed = {"part": POSITIONS, "probes": settings.count}

    def make_positions(folder: Path) -> None:
        np.save(folder / "positions.npy", placement.place(site.scene, settings.count))

    where = site.bakes.get("probes", placed, make_positions).folder / "positions.npy"
    files = {POSITIONS: where}
    mapped = {
        **placed,
        "mapping": settings.mapping,
        "width": settings.width,
        "height": settings.height,
    }
    if settings.mapping == ADAPTIVE:

        def make_parameterization(folder: Path) -> None:
            _bake_parameterization(site.scene, np.load(where), (settings.width, settings.height), folder)

        chosen = {**mapped, "part": "parameterization"}
        folder = site.bakes.get("probes", chosen, make_parameterization).folder
        files |= {name: folder / f"{name}.npy" for name in (FORWARD, INVERSE)}
    for part in dict.fromkeys(MAPS[name][0] for name in maps):
        chosen = {**mapped, "part": part}
        if part in (RADIANCE, LIGHT):
            chosen |= {"spp": settings.spp, "denoise": settings.denoise, "max_depth": site.max_depth}
            if settings.first_roughness != 1:
                chosen["first_roughness"] = settings.first_roughness

        def make(folder: Path, part: str = part, files: dict[str, Path] = files) -> None:
            narrowed = _first_materials(site, settings) if part == RADIANCE else None
            warp = load_warp(settings, files)
            baker = _Baker(site.scene, np.load(where), settings, narrowed, warp, max_depth=site.max_depth)
            if part in (RADIANCE, LIGHT):
                _bake_radiance(baker, part, folder)
            else:
                _bake_surfaces(baker, part, folder)

        folder = site.bakes.get("probes", chosen, make).folder
        files |= {name: folder / f"{name}.npy" for name in maps if MAPS[name][0] == part}
    return files
