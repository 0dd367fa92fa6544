"""Text of SAP2000 and ETABS: closed forms for what is assigned, and one building in both."""

import numpy as np
import pytest

from femupdate.building import load_building, mesh_building
from femupdate.fe import assemble, lowest_modes
from femupdate.fe.export_nastran import bulk_data
from tests.building.csi_texts import KG, etabs, sap2000


def read(tmp_path, text, ending):
    path = tmp_path / f"model.{ending}"
    path.write_text(text)
    return mesh_building(load_building(path))


def frequencies(mesh, count=6):
    return lowest_modes(assemble(mesh.model), np.ones(mesh.model.groups), count).frequency_hz


def mass(mesh):
    operators = assemble(mesh.model)
    everything = operators.rigid_translation(0)
    return everything @ (operators.mass_full @ everything)


def test_one_building_in_two_languages(tmp_path):
    sap = read(tmp_path, sap2000(), "s2k")
    assert mass(sap) == pytest.approx(KG, rel=1e-6)
    alike = "\n".join(line for line in sap2000().splitlines() if "Mass1=3" not in line)
    plain, other = read(tmp_path, alike, "s2k"), read(tmp_path, etabs(), "e2k")
    np.testing.assert_allclose(frequencies(other), frequencies(plain), rtol=1e-5)
    told = " ".join(sap.notes)
    for words in (
        "13 JOINT COORDINATES",
        "17 CONNECTIVITY - FRAME",
        "4 CONNECTIVITY - AREA",
        "loads 1 DEAD, 0.25 LIVE over g",
        "1 frames with modifiers J 0.1, I22 0.35, I33 0.35",
        "1 frames with end offsets, rigid by 0.5",
        "1 frames with released ends",
        "2 areas without bending",
        "1 GRID LINES",
    ):
        assert words in told, words
    names = load_building(tmp_path / "model.e2k").story_names
    assert names == ("Story1", "Story2")
    deck = tmp_path / "deck.bdf"
    deck.write_text(bulk_data(sap.model))
    back = mesh_building(load_building(deck, "N,m"))
    np.testing.assert_allclose(frequencies(back), frequencies(sap), rtol=1e-6)


# A cantilever of 4 m, .4 m along x and .2 m along y, with 50 t on top; kip and in below.
COLUMN = """
TABLE:  "PROGRAM CONTROL"
   ProgramName=SAP2000   CurrUnits="N, mm, C"
TABLE:  "MATERIAL PROPERTIES 02 - BASIC MECHANICAL PROPERTIES"
   Material=M   UnitMass=0   E1=30000   G12=12500   U12=0.2
TABLE:  "FRAME SECTION PROPERTIES 01 - GENERAL"
   SectionName=C   Material=M   Shape=General   t3=400   t2=200   Area=80000   TorsConst=7E+08 _
      I33=1066666667   I22=266666667   AS2=0   AS3=0
TABLE:  "JOINT COORDINATES"
   Joint=1   XorR=0   Y=0   Z=0
   Joint=2   XorR=0   Y=0   Z=4000
TABLE:  "CONNECTIVITY - FRAME"
   Frame=1   JointI=1   JointJ=2
TABLE:  "FRAME SECTION ASSIGNMENTS"
   Frame=1   AnalSect=C
TABLE:  "JOINT RESTRAINT ASSIGNMENTS"
   Joint=1   U1=Yes   U2=Yes   U3=Yes   R1=Yes   R2=Yes   R3=Yes
TABLE:  "JOINT ADDED MASS ASSIGNMENTS"
   Joint=2   Mass1=50   Mass2=50   Mass3=50
"""
STRONG, WEAK = 3.0 * 3e10 * 0.4**3 * 0.2 / 12.0, 3.0 * 3e10 * 0.2**3 * 0.4 / 12.0
MODIFIED = 'TABLE:  "FRAME PROPERTY MODIFIERS"\n   Frame=1   I33Mod=0.5   I22Mod=0.25\n'
ASSIGNED = {  # what is added, and the stiffness along x and y times the cube of the length
    "": (STRONG, WEAK, 4.0),
    'TABLE:  "FRAME LOCAL AXES ASSIGNMENTS 1 - TYPICAL"\n   Frame=1   Angle=90\n': (
        WEAK,
        STRONG,
        4.0,
    ),
    MODIFIED: (0.5 * STRONG, 0.25 * WEAK, 4.0),
    'TABLE:  "FRAME OFFSET ALONG LENGTH ASSIGNMENTS"\n'
    "   Frame=1   LengthI=800   LengthJ=0   RigidFactor=.5\n": (
        STRONG,
        WEAK,
        3.6,
    ),
    # Pinned below and held against rotation above, both ways.
    'TABLE:  "FRAME RELEASE ASSIGNMENTS 1 - GENERAL"\n   Frame=1   M2I=Yes   M3I=Yes\n'
    'TABLE:  "JOINT RESTRAINT ASSIGNMENTS"\n   Joint=2   R1=Yes   R2=Yes   R3=Yes\n': (
        STRONG,
        WEAK,
        4.0,
    ),
}


@pytest.mark.parametrize("added", ASSIGNED)
def test_what_is_assigned_has_its_closed_form(added, tmp_path):
    along_x, along_y, length = ASSIGNED[added]
    mesh = read(tmp_path, COLUMN + added, "s2k")
    operators = assemble(mesh.model)
    stiffness = sum(operators.stiffness_terms[1:], start=operators.stiffness_terms[0])
    flexible = np.linalg.inv((stiffness + operators.stiffness_constant).toarray())
    top = 6 + np.arange(2)
    place = np.searchsorted(operators.free, top)
    found = np.diag(flexible)[place] * np.array([along_x, along_y])
    np.testing.assert_allclose(found, length**3, rtol=1e-5)
    assert mass(mesh) == pytest.approx(50e3)
    deck = tmp_path / "deck.bdf"
    deck.write_text(bulk_data(mesh.model))
    back = mesh_building(load_building(deck, "N,m"))
    np.testing.assert_allclose(frequencies(back, 2), frequencies(mesh, 2), rtol=1e-6)
