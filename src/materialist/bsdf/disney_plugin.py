"""The paper's simplified Disney BRDF as a Mitsuba plugin (`materialist_disney`)."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from materialist.bsdf import lobes
from materialist.bsdf.disney import specular_probability
from materialist.bsdf.ggx import alpha_of

PLUGIN = "materialist_disney"


def register_disney() -> None:
    """Make the plugin known to the active variant."""

    class SimplifiedDisney(mi.BSDF):
        """f_r = f_s + (1 - M) f_d (paper, Preliminary); both sides shade alike.

        A ray meets the back only where shading normal and geometric normal agree on it. Directions below the face are
        mirrored to above it (`lobes.lifted`), so that no light passes through the surface and none is lost.

        Textures: base_color (RGB), roughness (perceptual, alpha = r^2), metallic.
        """

        def __init__(self, props: mi.Properties):
            mi.BSDF.__init__(self, props)
            self.base_color = props.get_texture("base_color")
            self.roughness = props.get_texture("roughness")
            self.metallic = props.get_texture("metallic")
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            # Component 0 is the diffuse lobe, 1 the specular one: `sample` names them so.
            self.m_components = [
                mi.BSDFFlags.DiffuseReflection | sides,
                mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.SpatiallyVarying | sides,
            ]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def traverse(self, cb):
            # PRB differentiates the picture by all three maps.
            cb.put("base_color", self.base_color, mi.ParamFlags.Differentiable)
            cb.put("roughness", self.roughness, mi.ParamFlags.Differentiable)
            cb.put("metallic", self.metallic, mi.ParamFlags.Differentiable)

        def _materials(self, si, active):
            albedo = mi.Color3f(self.base_color.eval(si, active))
            return albedo, self.roughness.eval_1(si, active), self.metallic.eval_1(si, active)

        def _specular_probability(self, cos_i, albedo, metallic):
            return dr.detach(specular_probability(cos_i, mi.luminance(albedo), metallic))

        def sample(self, ctx, si, sample1, sample2, active=True):
            # --- Choose a lobe; the probability carries no gradient, as sampling must not ---
            albedo, roughness, metallic = self._materials(si, active)
            wi = mi.Vector3f(si.wi.x, si.wi.y, dr.abs(si.wi.z))
            probability = self._specular_probability(wi.z, albedo, metallic)
            take_specular = sample1 < probability
            wo = lobes.sample_direction(wi, dr.detach(alpha_of(roughness)), take_specular, sample2)
            active = active & (wi.z > 0) & (wo.z > 0)
            # --- Back to the side of the surface that the ray meets, and above the face ---
            bs = mi.BSDFSample3f()
            side = self._side(si)
            bs.wo = lobes.lifted(mi.Vector3f(wo.x, wo.y, wo.z * side), self._face(si, side))
            value, pdf = self._both(si, bs.wo, probability, albedo, roughness, metallic)
            bs.pdf = dr.select(active, pdf, 0)
            active = active & (bs.pdf > 0)
            # --- What Mitsuba's integrators ask of a sample: its lobe, and value over density ---
            bs.eta = 1.0
            bs.sampled_type = dr.select(
                take_specular,
                mi.UInt32(+mi.BSDFFlags.GlossyReflection),
                mi.UInt32(+mi.BSDFFlags.DiffuseReflection),
            )
            bs.sampled_component = dr.select(take_specular, mi.UInt32(1), mi.UInt32(0))
            return bs, dr.select(active, value / dr.maximum(bs.pdf, 1e-20), mi.Color3f(0))

        def eval_pdf(self, ctx, si, wo, active=True):
            albedo, roughness, metallic = self._materials(si, active)
            # The density of the mixture counts both lobes, whichever of them drew `wo`.
            probability = self._specular_probability(dr.abs(si.wi.z), albedo, metallic)
            value, pdf = self._both(si, wo, probability, albedo, roughness, metallic)
            return dr.select(active, value, mi.Color3f(0)), dr.select(active, pdf, 0)

        def _side(self, si):
            """-1 where `si.wi` is behind the shading normal and the geometric normal of that side, else 1."""
            face = si.to_local(si.n)
            front = (si.wi.z > 0) | (dr.dot(face, si.wi) * face.z > 0)
            return dr.select(front, mi.Float(1), mi.Float(-1))

        def _face(self, si, side):
            """The face's normal in the shading frame, on that side of it; 0 where it is not believed."""
            return lobes.face_towards(si.to_local(si.n), mi.Vector3f(0, 0, side))

        def _both(self, si, wo, probability, *materials):
            """Value and density of `wo`: its own, and those of the direction that is lifted to it."""
            side = self._side(si)
            face = self._face(si, side)
            height = dr.dot(face, wo)
            below = wo - 2 * height * face
            # Two directions give `wo`: itself, and the one below the face that is mirrored to it.
            value, density = self._unlifted(
                si.wi, wo, probability, *materials, (height >= 0) & (side * wo.z > 0)
            )
            value_below, density_below = self._unlifted(
                si.wi, below, probability, *materials, (height > 0) & (side * below.z > 0)
            )
            return value + value_below, density + density_below

        def _unlifted(self, wi, wo, probability, albedo, roughness, metallic, active):
            """Value and density of a direction by the shading normal alone, 0 where not `active`."""
            # On the upper side: both sides shade alike.
            wi, wo = (mi.Vector3f(w.x, w.y, dr.abs(w.z)) for w in (wi, wo))
            value = lobes.reflectance(wi, wo, albedo, roughness, metallic)
            value = dr.select(active, value, mi.Color3f(0))
            density = lobes.density(wi, wo, dr.detach(alpha_of(roughness)), probability)
            return value, dr.select(active, density, 0)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_diffuse_reflectance(self, si, active=True):
            return self._materials(si, active)[0]

        def to_string(self):
            return f"SimplifiedDisney[{self.base_color}, {self.roughness}, {self.metallic}]"

    mi.register_bsdf(PLUGIN, SimplifiedDisney)
