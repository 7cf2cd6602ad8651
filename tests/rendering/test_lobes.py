"""The lobes of every kind of material: what is sampled of one alone, and what two of them sum to."""

import numpy as np
import pytest

from gibench.rendering.backend import is_scalar

COLOR = [0.6, 0.4, 0.2]
PRINCIPLED = {
    "type": "principled",
    "base_color": {"type": "rgb", "value": COLOR},
    "roughness": 0.5,
    "metallic": 0.3,
}
MATT = {"type": "diffuse", "reflectance": {"type": "rgb", "value": COLOR}}
COAT = {"type": "roughplastic", "alpha": 0.2, "distribution": "ggx"}
MATERIALS = {
    "diffuse": MATT,
    "coat": COAT,
    "pplastic": {"type": "pplastic", "alpha": 0.2, "diffuse_reflectance": {"type": "rgb", "value": COLOR}},
    "principled": PRINCIPLED,
    "two-sided": {"type": "twosided", "inside": PRINCIPLED},
    "blend": {"type": "blendbsdf", "weight": 0.4, "one": PRINCIPLED, "other": COAT},
    "mask": {"type": "mask", "opacity": 0.7, "inside": PRINCIPLED},
    "masked coat": {"type": "mask", "opacity": 0.7, "inside": COAT},
}
COUNT = 1 << 17


@pytest.fixture(params=MATERIALS)
def material(request):
    if is_scalar():
        pytest.skip("one lane at a time")
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.layers import Layers

    bsdf = mi.load_dict(MATERIALS[request.param])
    si = dr.zeros(mi.SurfaceInteraction3f, COUNT)
    si.t = mi.Float(1)
    si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Vector3f(0, 0, 1))
    si.wi = mi.Vector3f(0.6, 0.0, 0.8)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, COUNT)
    return request.param, Layers([bsdf]), mi.BSDFPtr(bsdf), si, sampler


def numbers(value) -> np.ndarray:
    return np.array(value).astype(np.float64)


def test_lobes_sum_to_the_material_and_samples_weigh_what_they_are(material):
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.lobes import diffuse_lobe, eval_pdf_sample_specular, sample_specular

    name, layers, bsdf, si, sampler = material
    on = dr.full(mi.Bool, True, COUNT)
    wo = mi.warp.square_to_uniform_hemisphere(sampler.next_2d())
    whole = numbers(bsdf.eval(mi.BSDFContext(), si, wo, on))
    diffuse = numbers(diffuse_lobe(layers, bsdf, si, wo, on))
    specular, _, _, weight = eval_pdf_sample_specular(
        layers, bsdf, si, wo, sampler.next_1d(), sampler.next_2d(), on
    )
    assert (diffuse >= 0).all()
    np.testing.assert_allclose(diffuse + numbers(specular), whole, rtol=1e-4, atol=1e-5)
    # Integrals over the hemisphere: by uniform directions, and by what is sampled of the specular lobes.
    by_value = numbers(specular).mean(axis=1) * 2 * np.pi
    bounce, other = sample_specular(layers, bsdf, si, sampler.next_1d(), sampler.next_2d(), on)
    upwards = numbers(bounce.wo)[2] > 0  # through a hole goes the rest
    by_samples = np.where(upwards, numbers(other), 0).mean(axis=1)
    np.testing.assert_allclose(by_samples, by_value, rtol=0.03, atol=1e-3)
    np.testing.assert_allclose(numbers(weight).mean(axis=1), numbers(other).mean(axis=1), rtol=0.03)
    if name == "diffuse":
        assert not numbers(specular).any()
        assert not numbers(other).any()


def test_paths_of_the_diffuse_lobe_alone_bring_its_integral(material):
    """Paths that reflect by the diffuse lobe alone, in uniform light, against that lobe's integral."""
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.integrator import scatter_paths
    from gibench.rendering.lobes import diffuse_lobe
    from gibench.rendering.sampling import IndependentSampler

    _, layers, bsdf, si, sampler = material
    on = dr.full(mi.Bool, True, COUNT)
    wo = mi.warp.square_to_uniform_hemisphere(sampler.next_2d())
    expected = numbers(diffuse_lobe(layers, bsdf, si, wo, on)).mean(axis=1) * 2 * np.pi
    paths = IndependentSampler()
    paths.independent.seed(1, COUNT)
    sky = mi.load_dict({"type": "scene", "sky": {"type": "constant", "radiance": 1.0}})
    found = scatter_paths(sky, paths, si, bsdf, on, max_depth=1, lobes="diffuse", layers=layers)
    np.testing.assert_allclose(numbers(found.direct_diffuse).mean(axis=1), expected, rtol=0.02)
    assert not numbers(found.direct_specular).any()


def test_what_the_diffuse_lobe_reflects_of_even_light(material):
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.lobes import diffuse_lobe, diffuse_reflectance

    name, layers, bsdf, si, sampler = material
    on = dr.full(mi.Bool, True, COUNT)
    wo = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    drawn = diffuse_lobe(layers, bsdf, si, wo, on) * dr.pi / wo.z
    expected = numbers(drawn).mean(axis=1)
    found = numbers(diffuse_reflectance(layers, bsdf, si, on))[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0.01)
    if name == "diffuse":
        np.testing.assert_allclose(found, COLOR, rtol=1e-5)
