"""`materialist_disney` against the paper's formulas in numpy, Mitsuba's chi-squared test, and finite differences."""

import disney_reference as brdf
import numpy as np
import pytest
from surfaces import (
    ALBEDO,
    NORMAL,
    directions,
    draws,
    evaluate,
    interaction,
    make,
    mi,
    pairs,
    tilted,
    vector,
)

GRID = [(0.04, 0.0), (0.1, 1.0), (0.2, 0.4), (0.5, 0.0), (0.5, 1.0), (1.0, 0.4)]


@pytest.mark.parametrize(("roughness", "metallic"), GRID)
def test_eval_is_the_papers_formula(roughness, metallic):
    wi, wo = pairs(4000, 3, roughness)
    expected = brdf.evaluate(np.array(ALBEDO), roughness, metallic, NORMAL, wi, wo) * wo[:, 2:]
    for flip in ([1, 1, 1], [1, 1, -1]):  # both sides shade alike
        value = evaluate(make(roughness=roughness, metallic=metallic), wi * flip, wo * flip)
        assert np.abs(value - expected).max() < 2e-3 * np.maximum(expected, 1e-2).max()
        assert np.median(np.abs(value / expected - 1)) < 1e-5
    through = evaluate(make(roughness=roughness, metallic=metallic), wi, wo * [1, 1, -1])
    assert (through == 0).all()


@pytest.mark.parametrize(
    ("roughness", "metallic"), [(0.02, 0.5), (0.2, 0.4), (0.5, 1.0), (1.0, 0.0)]
)
def test_sample_and_eval_pdf_agree(roughness, metallic):
    surface = make(roughness=roughness, metallic=metallic)
    ctx = mi.BSDFContext()
    wi = directions(4000, 5)
    wi[::2, 2] *= -1
    si = interaction(wi)
    sample, weight = surface.sample(ctx, si, *draws(4000, 0))
    value, pdf = surface.eval_pdf(ctx, si, sample.wo)
    assert np.array_equal(np.array(value), np.array(surface.eval(ctx, si, sample.wo)))
    assert np.array_equal(np.array(pdf), np.array(surface.pdf(ctx, si, sample.wo)))
    drawn = np.array(sample.pdf) > 0
    assert drawn.mean() > 0.5
    assert (np.array(sample.wo)[2][drawn] * wi[drawn, 2] > 0).all()
    assert np.array(pdf)[drawn] == pytest.approx(np.array(sample.pdf)[drawn], rel=1e-3)
    ratio = (np.array(value) / np.maximum(np.array(pdf), 1e-20))[:, drawn]
    assert np.array(weight)[:, drawn] == pytest.approx(ratio, rel=1e-3, abs=1e-6)
    assert (np.array(weight)[:, ~drawn] == 0).all()
    assert np.isfinite(np.array(weight)).all() and np.array(weight).max() < 12


def _leaning(wi, count=1, leans=True):
    """Interactions with a face that leans away by 30 degrees from the shading normal, or does not."""
    si = interaction(np.tile(wi, (count, 1)))
    if not leans:
        return si
    si.sh_frame = mi.Frame3f(mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1))
    si.n = mi.Normal3f(0, float(np.sin(np.pi / 6)), float(np.cos(np.pi / 6)))
    return si


@pytest.mark.parametrize(
    ("roughness", "metallic", "degrees", "side"),
    [(0.4, 0.5, 30, 1), (1, 0, 60, -1), (0.6, 1, 70, 1)],
)
def test_nothing_passes_through_a_face_that_leans_and_nothing_is_lost(
    roughness, metallic, degrees, side
):
    surface = make(roughness=roughness, metallic=metallic)
    ctx = mi.BSDFContext()
    wi = tilted(degrees, side)
    count = 1 << 17
    numbers = draws(count, 1)
    total = []
    for si in (interaction(np.tile(wi, (count, 1))), _leaning(wi, count)):
        sample, weight = surface.sample(ctx, si, *numbers)
        drawn = np.array(sample.pdf) > 0
        face = np.array(si.n)[:, 0]
        assert ((np.array(sample.wo).T @ face)[drawn] * (wi @ face) > -1e-5).all()
        total.append(np.array(weight).mean(1))
    np.testing.assert_allclose(total[1], total[0], rtol=0.02)
    without = (
        np.array(surface.sample(ctx, interaction(np.tile(wi, (count, 1))), *numbers)[0].wo).T @ face
    )
    assert (without * (wi @ face) < 0).mean() > 0.01  # which would pass


@pytest.mark.parametrize(
    ("roughness", "metallic", "degrees", "side", "leans"),
    [
        *(
            (0.3, 0, 5, 1, False),
            (0.3, 1, 40, -1, False),
            (0.45, 0.5, 60, 1, False),
            (0.6, 0, 80, -1, False),
        ),
        *(
            (0.6, 1, 80, 1, False),
            (1, 0.5, 40, -1, False),
            (0.5, 0.5, 30, 1, True),
            (1, 0.2, 60, -1, True),
        ),
    ],
)
def test_chi_squared(roughness, metallic, degrees, side, leans, capsys, tmp_path, monkeypatch):
    """Mitsuba's own test that directions are drawn with the density that `pdf` states."""
    from mitsuba.chi2 import ChiSquareTest, SphericalDomain

    monkeypatch.chdir(tmp_path)  # the test leaves its histogram in the current folder when it fails
    surface = make(roughness=roughness, metallic=metallic)
    ctx = mi.BSDFContext()
    wi = tilted(degrees, side)

    def at(directions):
        return _leaning(wi, len(np.array(directions)), leans)

    def draw(u):
        sample, _ = surface.sample(ctx, at(u[0]), u[0], mi.Point2f(u[1], u[2]))
        return sample.wo, mi.Float(np.array(sample.pdf) > 0)

    test = ChiSquareTest(
        SphericalDomain(),
        draw,
        lambda wo: surface.pdf(ctx, at(wo[0]), wo),
        sample_dim=3,
        sample_count=100_000,
        res=101,
        ires=16,
    )
    assert test.run(significance_level=0.001), capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "step"), [("base_color", 0.02), ("roughness", 0.004), ("metallic", 0.02)]
)
@pytest.mark.parametrize(("roughness", "metallic"), [(0.3, 0.35), (0.7, 0.8)])
def test_gradients_are_finite_differences_of_the_formula(name, step, roughness, metallic):
    """Forward derivative of eval against central differences of the float64 reference, in every parameter."""
    import drjit as dr

    surface = make(roughness=roughness, metallic=metallic)
    params = mi.traverse(surface)
    key = next(k for k in params.keys() if k.startswith(name))  # noqa: SIM118 - not a dict
    wi, wo = pairs(500, 8, roughness)
    dr.enable_grad(params[key])
    dr.set_grad(params[key], 1.0)
    params.update()
    value = surface.eval(mi.BSDFContext(), interaction(wi), vector(wo))
    gradient = np.array(dr.forward_to(value)).T

    def reference(shift):
        at = {"base_color": np.array(ALBEDO), "roughness": roughness, "metallic": metallic}
        at[name] = at[name] + shift
        return (
            brdf.evaluate(at["base_color"], at["roughness"], at["metallic"], NORMAL, wi, wo)
            * wo[:, 2:]
        )

    expected = (
        8 * (reference(step) - reference(-step)) - (reference(2 * step) - reference(-2 * step))
    ) / (12 * step)
    scale = np.abs(expected).max()
    assert scale > 0
    assert np.abs(gradient - expected).max() < 2e-3 * scale


def white_furnace(roughness, metallic, degrees, count=200_000):
    """Reflectance (green) of a white surface under constant light from everywhere."""
    si = interaction(np.broadcast_to(tilted(degrees), (count, 3)))
    _, weight = make((1, 1, 1), roughness, metallic).sample(mi.BSDFContext(), si, *draws(count, 1))
    return float(np.array(weight)[1].mean())


def test_white_furnace_equals_quadrature():
    """Sampling against a plain sum over the hemisphere of the reference."""
    wo = brdf.hemisphere(400)
    value = brdf.evaluate(np.ones(3), 0.6, 0.4, NORMAL, tilted(45), wo)[..., 1] * wo[..., 2]
    assert white_furnace(0.6, 0.4, 45) == pytest.approx(value.mean() * 2 * np.pi, rel=3e-3)
