"""Sections of beams and columns by shape: rectangle, T, I, pipe, circle, or by their figures."""

from dataclasses import dataclass, fields
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from femupdate.building.entry import Area, Complaints, Entry, Inertia, Label, Length

# Cowper's shear factors (1966, J. Appl. Mech. 33, 335-340) are taken for a Poisson's ratio of zero,
# as the 5/6 of the rectangle is; at 0.3 they lie 2 % (rectangle) to 6 % (pipe) higher.
_SHEAR_SHARE = 5.0 / 6.0


@dataclass(frozen=True)
class SectionFigures:
    """What a beam element needs to know of its section (m2, m4).

    y is the direction of the width, z that of the depth: a column's width lies along x and its
    depth along y, a beam's width is horizontal and its depth vertical. `inertia_y` resists bending
    with displacement along z. The axis runs through the centroid.
    """

    area: float
    shear_area_y: float
    shear_area_z: float
    inertia_y: float
    inertia_z: float
    torsion_constant: float
    # width and depth, m; those of the rectangle with the same figures where None
    extent: tuple[float, float] | None = None

    @property
    def size(self) -> tuple[float, float]:
        """Width along y and depth along z, m."""
        if self.extent is not None:
            return self.extent
        width, depth = np.sqrt(12.0 * np.array([self.inertia_z, self.inertia_y]) / self.area)
        return float(width), float(depth)


def rectangle_torsion_constant(width: float, depth: float) -> float:
    """Return Saint-Venant's torsion constant of a solid rectangle, m4.

    The series of Timoshenko and Goodier (Theory of Elasticity, 1951, article 94), for sides
    a >= b: J = a b^3 (1/3 - 64 b / (pi^5 a) sum over odd n of tanh(n pi a / 2 b) / n^5).
    """
    long, short = max(width, depth), min(width, depth)
    odd = np.arange(1, 100, 2)  # the rest of the series is below 1e-10 of the result
    series = np.sum(np.tanh(odd * np.pi * long / (2.0 * short)) / odd**5.0)
    return float(long * short**3 * (1.0 / 3.0 - 64.0 * short / (np.pi**5 * long) * series))


class _SectionShape(Entry):
    """What every section has: the material of its members, where the building has several."""

    material: Label | None = None


class RectangleSection(_SectionShape):
    """A solid rectangle."""

    shape: Literal["rectangle"]
    width: Length
    depth: Length

    def figures(self) -> SectionFigures:
        """Return the section's figures; the shear areas are 5/6 of the area."""
        area = self.width * self.depth
        return SectionFigures(
            area=area,
            shear_area_y=_SHEAR_SHARE * area,
            shear_area_z=_SHEAR_SHARE * area,
            inertia_y=self.width * self.depth**3 / 12.0,
            inertia_z=self.depth * self.width**3 / 12.0,
            torsion_constant=rectangle_torsion_constant(self.width, self.depth),
            extent=(self.width, self.depth),
        )


class TSection(_SectionShape):
    """A web under a flange, such as a beam with the slab that works with it.

    `depth` is the whole depth, flange included; `flange_width` is the effective width.
    """

    shape: Literal["T"]
    width: Length
    depth: Length
    flange_width: Length
    flange_thickness: Length

    def _complaints(self) -> Complaints:
        if self.flange_thickness >= self.depth:
            text = f"{self.flange_thickness:g} m must be less than the depth, {self.depth:g} m"
            yield ("flange_thickness", f"{text}; the depth is that of web and flange")
        if self.flange_width < self.width:
            text = f"{self.flange_width:g} m must not be less than the web's, {self.width:g} m"
            yield ("flange_width", f"{text}; correct one of the two")

    def figures(self) -> SectionFigures:
        """Return the figures about the centroid.

        The web over the whole depth carries the vertical shear and the flange the horizontal one,
        5/6 of each; the torsion constant is the sum of both rectangles'.
        """
        web_depth = self.depth - self.flange_thickness
        web, flange = self.width * web_depth, self.flange_width * self.flange_thickness
        between = 0.5 * self.depth  # of the two centroids
        area = web + flange
        return SectionFigures(
            area=area,
            shear_area_y=_SHEAR_SHARE * flange,
            shear_area_z=_SHEAR_SHARE * self.width * self.depth,
            inertia_y=(
                web * web_depth**2 / 12.0
                + flange * self.flange_thickness**2 / 12.0
                + web * flange / area * between**2
            ),
            inertia_z=(web * self.width**2 + flange * self.flange_width**2) / 12.0,
            torsion_constant=rectangle_torsion_constant(self.width, web_depth)
            + rectangle_torsion_constant(self.flange_width, self.flange_thickness),
            extent=(self.width, self.depth),
        )


class ISection(_SectionShape):
    """A doubly symmetric I or H, rolled (with a root radius) or welded."""

    shape: Literal["I"]
    width: Length
    depth: Length
    web_thickness: Length
    flange_thickness: Length
    root_radius: Length | None = None

    def _complaints(self) -> Complaints:
        radius = self.root_radius or 0.0
        if 2.0 * (self.flange_thickness + radius) >= self.depth:
            text = f"two of {self.flange_thickness:g} m leave no web in a depth of {self.depth:g} m"
            yield ("flange_thickness", f"{text}; correct one of the two")
        if self.web_thickness + 2.0 * radius > self.width:
            text = (
                f"{self.web_thickness:g} m is more than the width, {self.width:g} m, has room for"
            )
            yield ("web_thickness", f"{text}; correct one of the two")

    def figures(self) -> SectionFigures:
        """Return the section's figures.

        Shear area along the web by Cowper (1966), along the flanges 5/6 of theirs. Torsion constant
        of rolled sections by El Darwish and Johnston (1965, J. Struct. Div. ASCE 91, 203-227), of
        welded ones the same with no radius.
        """
        b, h, w, f = self.width, self.depth, self.web_thickness, self.flange_thickness
        r = self.root_radius or 0.0
        clear = h - 2.0 * f
        fillets = (4.0 - np.pi) * r**2
        arm = _fillet_arm(r)
        area = 2.0 * b * f + w * clear + fillets
        inertia_y = (b * h**3 - (b - w) * clear**3) / 12.0
        inertia_z = (2.0 * f * b**3 + clear * w**3) / 12.0
        return SectionFigures(
            area=area,
            shear_area_y=_SHEAR_SHARE * 2.0 * b * f,
            shear_area_z=_cowper_i(b, h - f, w, f) * area,
            inertia_y=inertia_y + fillets * (clear / 2.0 - arm) ** 2 + 4.0 * _fillet_inertia(r),
            inertia_z=inertia_z + fillets * (w / 2.0 + arm) ** 2 + 4.0 * _fillet_inertia(r),
            torsion_constant=_rolled_torsion_constant(b, clear, w, f, r),
            extent=(b, h),
        )


def _fillet_arm(radius: float) -> float:
    """Distance of a fillet's centroid from the two faces that it joins, m."""
    return float(radius * (10.0 - 3.0 * np.pi) / (12.0 - 3.0 * np.pi))


def _fillet_inertia(radius: float) -> float:
    """Second moment of one fillet, a square less a quarter circle, about its own centroid, m4."""
    area = (1.0 - np.pi / 4.0) * radius**2
    about_centre = radius**4 * (1.0 / 3.0 - np.pi / 16.0)  # of the circle, where the square ends
    return float(about_centre - area * (radius - _fillet_arm(radius)) ** 2)


def _cowper_i(width: float, depth: float, web: float, flange: float) -> float:
    """Shear factor along the web of a thin-walled I, depth between the flanges' middles."""
    m, n = 2.0 * width * flange / (depth * web), width / depth
    below = 12.0 + 72.0 * m + 150.0 * m**2 + 90.0 * m**3 + 30.0 * n**2 * (m + m**2)
    return 10.0 * (1.0 + 3.0 * m) ** 2 / below


def _rolled_torsion_constant(
    width: float, clear: float, web: float, flange: float, radius: float
) -> float:
    ratio = radius / flange
    alpha = (
        -0.042
        + 0.2204 * web / flange
        + 0.1355 * ratio
        - 0.0865 * ratio * web / flange
        - 0.0725 * (web / flange) ** 2
    )
    circle = ((flange + radius) ** 2 + web * (radius + web / 4.0)) / (2.0 * radius + flange)
    plates = (2.0 * width * flange**3 + clear * web**3) / 3.0
    return float(plates + 2.0 * alpha * circle**4 - 0.420 * flange**4)


class PipeSection(_SectionShape):
    """A circular pipe of this outer diameter and wall thickness."""

    shape: Literal["pipe"]
    diameter: Length
    thickness: Length

    def _complaints(self) -> Complaints:
        if 2.0 * self.thickness >= self.diameter:
            text = f"two of {self.thickness:g} m fill a diameter of {self.diameter:g} m"
            yield ("thickness", f'{text}; write a thinner wall, or shape = "circle"')

    def figures(self) -> SectionFigures:
        """Return the section's figures; shear areas by Cowper (1966)."""
        return _round(self.diameter, self.diameter - 2.0 * self.thickness)


class CircleSection(_SectionShape):
    """A solid circle."""

    shape: Literal["circle"]
    diameter: Length

    def figures(self) -> SectionFigures:
        """Return the section's figures; shear areas by Cowper (1966)."""
        return _round(self.diameter, 0.0)


def _round(outer: float, inner: float) -> SectionFigures:
    area = np.pi / 4.0 * (outer**2 - inner**2)
    inertia = np.pi / 64.0 * (outer**4 - inner**4)
    square = (1.0 + (inner / outer) ** 2) ** 2
    shear = 6.0 * square / (7.0 * square + 20.0 * (inner / outer) ** 2) * area
    return SectionFigures(area, shear, shear, inertia, inertia, 2.0 * inertia, (outer, outer))


class FiguresSection(_SectionShape):
    """A section of any shape, given by its figures (axes as in `SectionFigures`)."""

    shape: Literal["figures"]
    area: Area
    shear_area_y: Area
    shear_area_z: Area
    inertia_y: Inertia
    inertia_z: Inertia
    torsion_constant: Inertia

    def figures(self) -> SectionFigures:
        """Return the section's figures."""
        names = [item.name for item in fields(SectionFigures) if item.name != "extent"]
        return SectionFigures(**{name: getattr(self, name) for name in names})


Section = Annotated[
    RectangleSection | TSection | ISection | PipeSection | CircleSection | FiguresSection,
    Field(discriminator="shape"),
]
