"""Text of SAP2000 and ETABS: closed forms for what is assigned, and one building in both."""

import numpy as np
import pytest

from femupdate.building import load_building, mesh_building
from femupdate.building.model_files import write_draft
from femupdate.dynamics import mesh_modes
from femupdate.effects import structure_of
from femupdate.fe import assemble, bulk_data
from tests.building.csi_texts import KG, etabs, sap2000
from tests.building.test_deck import frequencies, mass

LOG = '$ LOG\n  STARTCOMMENTS\n{\n  "Version": null\n}\n  ENDCOMMENTS\n'


def read(tmp_path, text, ending):
    path = tmp_path / f"model.{ending}"
    path.write_text(text)
    return mesh_building(load_building(path))


def test_one_building_in_two_languages(tmp_path):
    sap = read(tmp_path, sap2000(), "s2k")
    assert mass(sap) == pytest.approx(KG, rel=1e-6)
    alike = "\n".join(line for line in sap2000().splitlines() if "Mass1=3" not in line)
    plain, other = read(tmp_path, alike, "s2k"), read(tmp_path, etabs() + LOG, "e2k")
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
    told = " ".join(other.notes)  # not of the detailing that ETABS keeps among its comments
    assert "at stories in ETABS" in told
    assert "VERSION" not in told
    assert load_building(tmp_path / "model.e2k").story_names == ("Story1", "Story2")


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
END = "END TABLE DATA\n"
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
    mesh = read(tmp_path, COLUMN + added + END, "s2k")
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


@pytest.mark.parametrize("mass", [5, 50, 500])
def test_a_draft_asks_for_frequencies_that_a_slow_cantilever_has(mass, tmp_path):
    (tmp_path / "column.s2k").write_text(COLUMN.replace("=50", f"={mass}") + END)
    drafted = load_building(write_draft(tmp_path / "column.s2k", None, tmp_path / "own.toml"))
    modes = mesh_modes(structure_of(drafted))  # fewer than are looked for
    expected = np.sqrt(np.array([WEAK, STRONG]) / 4.0**3 / (1e3 * mass)) / (2.0 * np.pi)
    np.testing.assert_allclose(modes.frequency_hz[:2], expected, rtol=1e-5)
    grid = drafted.frequency_grid
    assert abs(grid.frequencies_hz()[-1] - 8.0 * expected[0]) <= grid.step


def test_a_mass_at_one_node_turns_in_torsion(tmp_path):
    path = tmp_path / "column.s2k"
    path.write_text(COLUMN.replace("Mass3=50", "Mass3=0   MMI3=1E+08") + END)
    modes = mesh_modes(structure_of(load_building(path)))
    assert modes.direction == ("Y", "torsion", "X")


def test_a_direction_without_mass_has_no_share(tmp_path):
    path = tmp_path / "column.s2k"
    path.write_text(COLUMN.replace("Mass2=50   Mass3=50", "Mass2=0   Mass3=0") + END)
    modes = mesh_modes(structure_of(load_building(path)))
    np.testing.assert_allclose(modes.effective_mass, [[1.0, 0.0]], rtol=1e-6)


# Other ways of writing the same building: what stands in place of what.
SPELT = {
    "e2k: version 9": (
        ('TYPE "Concrete"    WEIGHTPERVOLUME 24.516625', "M 2.5  W 24.516625"),
        ('SYMTYPE "Isotropic"  E', 'TYPE "ISOTROPIC"  E'),
        ('UNITS  "KN"  "M"  "C"', 'UNITS  "KN"  "M"'),
        ("LOADPATTERN", "LOADCASE"),
        ("I22MODIFIER 0.7  I33MODIFIER 0.7", "I2MOD 0.7  I3MOD 0.7"),
        ('MODELINGTYPE "Membrane"  SLABTYPE "Slab"  SLABTHICKNESS', 'TYPE "MEMBRANE"  TM'),
        (
            '  MASSSOURCE  "MsSrc1"    INCLUDEELEMENTS "No"    INCLUDEADDEDMASS "No"    '
            'INCLUDELOADS "Yes"    LUMPATSTORIES "Yes"    ISDEFAULT "Yes"',
            '  MASSOPTIONS  GRAVITY 9.81  SOURCE "LOADS"  LATERALONLY "YES"',
        ),
        ('MASSSOURCELOAD  "MsSrc1"  "Dead"  1', 'MASSOPTIONS  LOAD "Dead"  FACTOR 1'),
        ('MASSSOURCELOAD  "MsSrc1"  "Live"  0.25', 'MASSOPTIONS  LOAD "Live"  FACTOR 0.25'),
    ),
    "e2k: decimal commas": (("0.25", "0,25"), ("0.5", "0,5"), (" 2.5 0", " 2,5 0")),
    "e2k: an opening and a section that nothing uses": (
        (
            "$ AREA ASSIGNS",
            '  AREAASSIGN "W1" "Story1" OPENING "Yes"\n'
            '  FRAMESECTION "CFT" MATERIAL "C30" SHAPE "Filled Steel Tube" D 1 B 1\n'
            '  SHELLPROP "R" PROPTYPE "Slab" MATERIAL "C30" SLABTYPE "Waffle" SLABTHICKNESS 1',
        ),
    ),
    "e2k: an assignment on two lines": (
        (
            '  LINEASSIGN "B5" "Story2" SECTION "BEAM 1" RELEASE',
            '  LINEASSIGN "B5" "Story2" SECTION "COL"\n'
            '  LINEASSIGN "B5" "Story2" SECTION "BEAM 1"\n  LINEASSIGN "B5" "Story2" RELEASE',
        ),
    ),
    "s2k: a material in place of the section's": (
        ("SectionName=COL   Material=C30", "SectionName=COL   Material=C99"),
        ('AnalSect="COL"   MatProp=Default', 'AnalSect="COL"   MatProp=C30'),
    ),
    "s2k: version 9": (
        ("PATTERN DEFINITIONS", "CASE DEFINITIONS"),
        ("LoadPat", "LoadCase"),
        ("02 - BASIC MECHANICAL PROPERTIES", "01 - GENERAL"),
        ("E1=30000000   G12=12500000   U12=0.2", "Type=Isotropic   E=30000000   U=0.2"),
    ),
    "s2k: loads handed to frames": (('"AREA LOADS - UNIFORM"', '"AREA LOADS - UNIFORM TO FRAME"'),),
    "s2k: an older mass source": (
        ("MASS SOURCE", "MASSES 1 - MASS SOURCE"),
        (
            "MassSource=MSSSRC1   Elements=No   Masses=Yes   Loads=Yes   IsDefault=Yes",
            "MassFrom=Loads",
        ),
        ("MassSource=MSSSRC1   LoadPat=LIVE", "LoadPat=LIVE"),
        ("Mass1=3   Mass2=3   Mass3=3", "Mass1=0   Mass2=0   Mass3=0"),
    ),
    "s2k: sections that nothing uses, and areas without one": (
        (
            "\n   Section=SLAB   Material",
            "\n   Section=P   Material=NONE   Type=Plate   Thickness=1\n   Section=SLAB   Material",
        ),
        (
            "   SectionName=COL ",
            "   SectionName=VAR   Shape=Nonprismatic\n   SectionName=COL ",
        ),
        (
            'TABLE:  "CONNECTIVITY - AREA"\n',
            'TABLE:  "CONNECTIVITY - AREA"\n   Area=9   NumJoints=3   Joint1=1   Joint2=2'
            "   Joint3=3\n"
            'TABLE:  "AREA SECTION ASSIGNMENTS"\n   Area=9   Section=None\n'
            'TABLE:  "CONNECTIVITY - AREA"\n',
        ),
    ),
    "s2k: masses and loads at other places": (
        (
            'TABLE:  "JOINT ADDED MASS',
            'TABLE:  "FRAME ADDED MASS ASSIGNMENTS"\n   Frame=5   MassPerLen=1.0197162\n'
            'TABLE:  "AREA ADDED MASS ASSIGNMENTS"\n   Area=1   MassPerArea=0.050985811\n'
            'TABLE:  "FRAME LOADS - POINT"\n   Frame=6   LoadPat=DEAD   Dir=Gravity   RelDist=1'
            '   Force=29.41995\nTABLE:  "JOINT ADDED MASS',
        ),
        ("Mass1=3   Mass2=3   Mass3=3", "Mass1=0   Mass2=0   Mass3=0"),
        ("LoadPat=LIVE   CoordSys=GLOBAL   Dir=Gravity   UnifLoad=2", "LoadPat=WIND   UnifLoad=2"),
        ("FOverLA=10   FOverLB=10", "FOverLA=0   FOverLB=0"),
    ),
}


@pytest.mark.parametrize("case", SPELT)
def test_another_spelling_is_the_same_building(case, tmp_path):
    ending = case.partition(":")[0]
    text = usual = {"e2k": etabs, "s2k": sap2000}[ending]()
    for old, new in SPELT[case]:
        assert old in text, old
        text = text.replace(old, new)
    if "older" in case:
        usual = usual.replace("Mass1=3   Mass2=3   Mass3=3", "Mass1=0   Mass2=0   Mass3=0")
    expected, found = read(tmp_path, usual, ending), read(tmp_path, text, ending)
    assert mass(found) == pytest.approx(mass(expected), rel=1e-6)
    np.testing.assert_allclose(frequencies(found), frequencies(expected), rtol=1e-6)


def test_a_section_that_is_only_named_is_given_beside_the_model(tmp_path):
    text = etabs().replace('SHAPE "Concrete Rectangular"  D 0.5  B 0.4', 'SHAPE "W14X90"')
    (tmp_path / "model.e2k").write_text(text)
    draft = write_draft(tmp_path / "model.e2k", None, tmp_path / "own.toml")
    lines = draft.read_text().splitlines()
    start = lines.index('# [sections."COL"]')
    lines[start : start + 6] = [
        '[sections."COL"]',
        'shape = "rectangle"',
        'width = "0.4 m"',
        'depth = "0.5 m"',
    ]
    draft.write_text("\n".join(lines))
    expected = read(tmp_path, etabs(), "e2k")
    np.testing.assert_allclose(
        frequencies(mesh_building(load_building(draft))), frequencies(expected), rtol=1e-9
    )
