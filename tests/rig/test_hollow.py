"""Hollow shapes: outer minus inner, shells as the limit of walls, and each shell in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad
from solids import BOX, pose, same

import articulated as art


def shell(geometry) -> art.MassProperties:
    return art.mass_properties(art.Hollow(geometry), mass=1.0)


OUTER = {
    "sphere": (art.Sphere(0.3), lambda w: art.Sphere(0.3 - w)),
    "box": (art.Box((0.4, 0.7, 0.5)), lambda w: art.Box((0.4 - 2 * w, 0.7 - 2 * w, 0.5 - 2 * w))),
    "cylinder": (art.Cylinder(0.3, 0.8), lambda w: art.Cylinder(0.3 - w, 0.8 - 2 * w)),
    "capsule": (art.Capsule(0.3, 0.8), lambda w: art.Capsule(0.3 - w, 0.8)),
    "ellipsoid": (art.Ellipsoid((0.2, 0.3, 0.5)), lambda w: art.Ellipsoid((0.2 - w, 0.3 - w, 0.5 - w))),
}
"""An outer shape, and what fills it within a wall."""


class TestHollow:
    @pytest.mark.parametrize("kind", OUTER)
    @pytest.mark.parametrize("wall", [0.199, 0.05, 1e-3])
    def test_outer_minus_inner(self, kind, wall):
        outer, inner = OUTER[kind]
        a, b = art.mass_properties(outer, 1.0), art.mass_properties(inner(wall), 1.0)
        got = art.mass_properties(art.Hollow(outer, wall), 1.0)
        assert got.mass == pytest.approx(a.mass - b.mass, rel=1e-14 / wall)
        np.testing.assert_allclose(got.inertia, a.inertia - b.inertia, rtol=1e-14 / wall)
        np.testing.assert_allclose(got.center, 0.0, atol=1e-16)

    @pytest.mark.parametrize("wall", [0.1, 1e-3])
    def test_a_cone(self, wall):
        """The inner cone has the same angle; its faces are those of the outer one, moved inwards by the wall."""
        R, L = 0.3, 0.8
        slant = np.hypot(R, L)
        bottom, apex = -L / 2 + wall, L / 2 - wall * slant / R
        l = apex - bottom
        inner = art.Shape(art.Cone(l * R / L, l), pose(at=(0.0, 0.0, 0.5 * (bottom + apex))))
        a, b = art.mass_properties(art.Cone(R, L), 1.0), art.mass_properties(inner, 1.0)
        got = art.mass_properties(art.Hollow(art.Cone(R, L), wall), 1.0)
        same(got + b, a, 1e-13)

    @pytest.mark.parametrize("thin", [1e-6, 1e-12])
    @pytest.mark.parametrize("kind", [*OUTER, "cone"])
    def test_a_thin_wall_keeps_its_digits(self, kind, thin):
        """As its wall grows thin, what is hollow becomes a shell, in proportion to the thickness."""
        outer = OUTER[kind][0] if kind in OUTER else art.Cone(0.3, 0.8)
        wall, double = (art.mass_properties(art.Hollow(outer, w), 1.0) for w in (thin, 2 * thin))
        np.testing.assert_allclose(double.mass / wall.mass, 2.0, rtol=1e2 * thin + 1e-15)
        if kind == "ellipsoid":
            return  # its inner ellipsoid is not parallel to it
        shell = art.mass_properties(art.Hollow(outer), mass=wall.mass)
        same(wall, shell, 1e2 * thin + 1e-14)

    def test_shells_in_closed_form(self):
        """Per unit of mass: 2/3 r²; a cone of slant s has its centre at h/3; a tube with lids from its three parts."""
        np.testing.assert_allclose(shell(art.Sphere(0.3)).inertia, np.eye(3) * 2 / 3 * 0.09, rtol=1e-13)
        R, L = 0.3, 0.8
        side, base = np.pi * R * np.hypot(R, L), np.pi * R * R
        cone = shell(art.Cone(R, L))
        center = side / (side + base) * L / 3
        assert cone.center[2] == pytest.approx(center - L / 2, rel=1e-13)
        along = (side * R * R / 2 + base * R * R / 2) / (side + base)
        across = (side * (R * R / 4 + L * L / 6) + base * R * R / 4) / (side + base) - center**2
        np.testing.assert_allclose(cone.inertia, np.diag([across, across, along]), rtol=1e-13)
        tube, lids = 2 * np.pi * R * L, 2 * np.pi * R * R
        along = (tube * R * R + lids * R * R / 2) / (tube + lids)
        across = (tube * (R * R / 2 + L * L / 12) + lids * (R * R / 4 + L * L / 4)) / (tube + lids)
        np.testing.assert_allclose(shell(art.Cylinder(R, L)).inertia, np.diag([across, across, along]), rtol=1e-13)
        tube, balls = 2 * np.pi * R * L, 4 * np.pi * R * R
        along = (tube * R * R + balls * 2 / 3 * R * R) / (tube + balls)
        # a half sphere's centre is R/2 from its rim's
        across = (tube * (R * R / 2 + L * L / 12) + balls * (2 / 3 * R * R + L * L / 4 + R * L / 2)) / (tube + balls)
        np.testing.assert_allclose(shell(art.Capsule(R, L)).inertia, np.diag([across, across, along]), rtol=1e-13)
        x, y, z = 0.4, 0.7, 0.5
        squares = [
            (y * z * x * x / 2 + x * (y + z) * x * x / 6, 2 * (y * z + x * (y + z)))
            for x, y, z in ((x, y, z), (y, z, x), (z, x, y))
        ]
        second = np.array([a / b for a, b in squares])
        np.testing.assert_allclose(shell(art.Box((x, y, z))).inertia, np.diag(second.sum() - second), rtol=1e-13)

    def test_an_ellipsoids_shell(self):
        """A sphere; a spheroid, by a single integral over its profile; and the surface of a fine mesh."""
        np.testing.assert_allclose(shell(art.Ellipsoid((0.3,) * 3)).inertia, np.eye(3) * 2 / 3 * 0.09, rtol=1e-13)
        for a, c in ((0.3, 0.9), (0.9, 0.3)):

            def ring(t, a=a, c=c):
                return 2 * np.pi * a * np.cos(t) * np.hypot(a * np.sin(t), c * np.cos(t))

            area, axial, radial = (
                2 * quad(lambda t, f=f: ring(t) * f(t), 0, np.pi / 2, epsabs=0, epsrel=1e-13)[0]
                for f in (lambda t: 1.0, lambda t: (c * np.sin(t)) ** 2, lambda t: (a * np.cos(t)) ** 2 / 2)  # noqa: B023
            )
            across = (axial + radial) / area
            got = shell(art.Ellipsoid((a, a, c)))
            np.testing.assert_allclose(got.inertia, np.diag([across, across, 2 * radial / area]), rtol=1e-12)
        mesh = trimesh.creation.icosphere(5, 1.0).apply_transform(np.diag([0.2, 0.3, 0.5, 1.0]))
        second = (mesh.area_faces @ mesh.triangles_center**2) / mesh.area
        got = shell(art.Ellipsoid((0.2, 0.3, 0.5)))
        np.testing.assert_allclose(np.diag(got.inertia), second.sum() - second, rtol=2e-3)

    def test_several_shells_are_of_one_sheet(self):
        balls = [art.Hollow(art.Sphere(0.1)), art.Shape(art.Hollow(art.Sphere(0.2)), pose(at=(1.0, 0.0, 0.0)))]
        assert art.mass_properties(balls, mass=5.0).center[0] == pytest.approx(0.8)

    def test_a_football(self):
        """A body that weighs what its wall does, and touches as its outside."""
        rig = art.loose_body(art.Hollow(art.Sphere(0.11)), mass=0.43)
        link = rig.links["body"]
        assert (rig.name, rig.mass) == ("sphere", 0.43)
        assert link.collisions[0].geometry == link.visuals[0].geometry == art.Sphere(0.11)
        np.testing.assert_allclose(link.inertia, np.eye(3) * 0.43 * 2 / 3 * 0.11**2)

    @pytest.mark.parametrize(
        ("outer", "most"),
        [
            (art.Sphere(0.3), 0.3),
            (art.Box((0.4, 0.7, 0.5)), 0.2),
            (art.Cylinder(0.3, 0.8), 0.3),
            (art.Cylinder(0.3, 0.2), 0.1),
            (art.Capsule(0.3, 0.1), 0.3),
            (art.Ellipsoid((0.4, 0.2, 0.5)), 0.2),
            (art.Cone(0.3, 0.4), 0.15),
        ],
    )
    def test_too_thick(self, outer, most):
        for wall in (most, 2 * most, 0.0, -1.0, np.nan, "thin"):
            with pytest.raises(
                ValueError, match=rf"{type(outer).__name__}.* has a wall of .*; give more than zero and less than"
            ):
                art.mass_properties(art.Hollow(outer, wall))
        art.mass_properties(art.Hollow(outer, most * (1 - 1e-9)))

    def test_refused(self):
        for geometry, message in (
            (art.Hollow(art.Sphere(0.1)), r"an infinitely thin shell has no volume .*; give mass=, or the Hollow a wall"),
            ([art.Hollow(art.Sphere(0.1)), BOX], r"thin shells and solids have no one density; weigh them apart"),
            (art.Hollow(art.Mesh("a.stl"), 0.1), r"Hollow of Mesh.*; give a Sphere, Box, Cylinder, Capsule, Cone or Ellipsoid"),
            (art.Hollow(art.Hollow(BOX)), r"Hollow of Hollow"),
            (art.Ellipsoid((0.1, 0.2)), r"ellipsoid has size \(0\.1, 0\.2\); give 3 numbers"),
            (art.Cone(0.1, -0.2), r"cone has size \(0\.1, -0\.2\); give positive lengths"),
        ):
            with pytest.raises(ValueError, match=message):
                art.mass_properties(geometry)
