"""Decks of Nastran as buildings: read back exactly, and spoiled ones told in words."""

import re

import numpy as np
import pytest

from femupdate.building import load_building, mechanics_hash, mesh_building, save_building
from femupdate.building.model_files import draft_text, write_draft
from femupdate.dynamics import choose_members
from femupdate.errors import BuildingError, StructureError
from femupdate.fe import assemble, bulk_data, lowest_modes
from femupdate.interface import inspect


def frequencies(mesh, count=6):
    return lowest_modes(assemble(mesh.model), np.ones(mesh.model.groups), count).frequency_hz


def mass(mesh):
    operators = assemble(mesh.model)
    everything = operators.rigid_translation(0)
    return everything @ (operators.mass_full @ everything)


@pytest.mark.parametrize("name", ["six_story_wall_frame", "two_story_openings"])
def test_a_shipped_building_comes_back(name, tmp_path):
    mesh = mesh_building(load_building(name), 1.2)
    path = tmp_path / "model.bdf"
    path.write_text(bulk_data(mesh.model))
    building = load_building(path)
    read = mesh_building(building)
    np.testing.assert_allclose(building.floor_levels, mesh.floor_level)
    np.testing.assert_allclose(frequencies(read), frequencies(mesh), rtol=1e-6)
    np.testing.assert_allclose(mass(read), mass(mesh), rtol=1e-8)
    theta = np.linspace(0.5, 2.0, mesh.model.groups)
    expected, found = (lowest_modes(assemble(m.model), theta, 3).frequency_hz for m in (mesh, read))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    kept = load_building(save_building(building, tmp_path / "study" / "building.toml"))
    np.testing.assert_allclose(frequencies(mesh_building(kept)), frequencies(read), rtol=1e-12)


# Two stories of 3 m on four columns, in N and mm, with small and free fields.
FRAME = """\
SOL 103
CEND
SPC = 7
BEGIN BULK
$ columns, slabs and a wall in N, mm and t
GRID           1              0.      0.      0.
GRID           2           4000.      0.      0.
GRID,3,,4.+3,3000.,0.
GRID,4,,0.,3.E3,0.
GRID    5               0.      0.      3000.
GRID    6               4000.   0.      3000.
GRID    7               4000.   3000.   3000.
GRID    8               0.      3000.   3000.
CORD2R  9               0.      0.      3000.   0.      0.      4000.
+       1000.   0.      3000.
GRID*                  9               9              0.              0.*
*                 3000.0
GRID    10      9       4000.   0.      3000.
GRID    11      9       4000.   3000.   3000.
GRID    12      9       0.      3000.   3000.
GRID,99,,1.,1.,1.
CBAR    1       1       1       5       0.      1.      0.
CBAR    2       1       2       6       0.      1.      0.
CBAR    3       1       3       7       0.      1.      0.
CBAR    4       1       4       8       0.      1.      0.
CBEAM   5       2       5       9       0.      1.      0.
CBEAM   6       2       6       10      0.      1.      0.
CBEAM   7       2       7       11      0.      1.      0.
CBEAM   8       2       8       12      5
CQUAD4  11      3       5       6       7       8
CTRIA3  12      3       9       10      11
CTRIA3  13      3       9       11      12
CQUAD4,14,3,1,2,6,5
CROD    15      5       4       7
PBARL   1       1               BAR                                     +
+       300.    400.
PBEAM   2       1       1.2+5   1.6+9   .9+9            2.+9
PSHELL  3       1       200.    1       1.      1
PROD    5       2       2000.
MAT1    1       3.+4            .2      2.5-9
MAT1    2       2.1+5           .3      7.85-9
CONM2   21      9               12.5
CONM2   22      11              2.5             500.    0.      0.
SPC1    7       123456  1       THRU    4
SPC1    8       123     5
GRAV    1               9810.   0.      0.      -1.
EIGRL   1                       10
PARAM   POST    -1
ENDDATA
"""


def write(tmp_path, text):
    path = tmp_path / "frame.bdf"
    path.write_text(text, encoding="latin-1")
    return path


def test_a_deck_by_hand_is_read_with_its_units_floors_and_kinds(tmp_path):
    building = load_building(write(tmp_path, FRAME))
    assert (building.mesh.unit, building.mesh.force) == ("mm", "N")
    np.testing.assert_allclose(building.floor_levels, [3.0, 6.0])
    mesh = mesh_building(building)
    kinds = [kind for block in mesh.model.elements for kind in block.kind.tolist()]
    assert sorted(set(kinds)) == ["brace", "column", "slab", "wall"]
    assert [kinds.count(kind) for kind in ("column", "brace", "slab", "wall")] == [8, 1, 3, 1]
    shells = 2500.0 * 0.2 * (12.0 + 12.0 + 12.0)
    lines = 2500.0 * 3.0 * 4 * (0.12 + 0.12) + 7850.0 * 0.002 * 5.0
    np.testing.assert_allclose(mass(mesh), shells + lines + 15e3, rtol=1e-6)
    told = " ".join(mesh.notes)
    for text in ("12 GRID", "1 CROD", "2 CONM2", "1 EIGRL", "1 GRAV", "1 PARAM", "another set"):
        assert text in told, text
    assert "1 GRID that nothing uses" in told
    assert mesh.walls == ("W1",)
    assert frequencies(mesh, 1)[0] > 1.0


def test_what_a_deck_includes_is_part_of_it(tmp_path):
    start, end = FRAME.index("CBAR    1"), FRAME.index("CONM2   21")
    (tmp_path / "members.inc").write_text(FRAME[start:end])
    path = write(tmp_path, FRAME)
    whole = load_building(path)
    expected = frequencies(mesh_building(whole))
    write(tmp_path, FRAME[:start] + "INCLUDE './\nmembers.inc'\n" + FRAME[end:])
    parts = load_building(path)
    np.testing.assert_allclose(frequencies(mesh_building(parts)), expected, rtol=1e-9)
    before = mechanics_hash(parts)
    (tmp_path / "members.inc").write_text(FRAME[start:end].replace("300.    400.", "300.    500."))
    assert mechanics_hash(parts) != before


def test_mass_and_shear_of_a_deck_are_as_it_says(tmp_path):
    plain, lumped = (
        mesh_building(load_building(write(tmp_path, FRAME.replace("PARAM   POST", param))))
        for param in ("PARAM   POST", "PARAM,COUPMASS,-1\nPARAM   POST")
    )
    assert not lumped.model.elements[0].density.any()
    assert mass(lumped) == pytest.approx(mass(plain))
    assert "COUPMASS: masses of elements are lumped" in " ".join(lumped.notes)
    told = "PSHELL of another shear stiffness"
    thin = load_building(write(tmp_path, FRAME.replace("1       1.      1\n", "1       1.\n")))
    assert told in " ".join(mesh_building(thin).notes)
    back = load_building(write(tmp_path, bulk_data(plain.model)), "N,m")
    assert told not in " ".join(mesh_building(back).notes)


def test_units_scale_everything_alike(tmp_path):
    path = write(tmp_path, FRAME.replace("2.5-9", "0.").replace("7.85-9", "0."))
    with pytest.raises(BuildingError, match=r"no units.*say force and length by --units"):
        load_building(path)
    light = frequencies(mesh_building(load_building(path, "N,mm")))
    heavy = frequencies(mesh_building(load_building(path, "kN,mm")))
    np.testing.assert_allclose(heavy, light, rtol=1e-6)  # stiffness and mass a thousandfold


@pytest.mark.parametrize("units", ["N,m", "kN,mm", "kip,in"])
def test_units_that_make_its_materials_unusual_are_refused(tmp_path, units):
    told = f"its materials are usual ones in N,mm, and none in {units}; correct --units"
    with pytest.raises(BuildingError, match=told):
        load_building(write(tmp_path, FRAME), units)


def test_a_weight_density_is_told_by_wtmass(tmp_path):
    text = FRAME.replace("2.5-9", "2.452-5").replace("7.85-9", "7.698-5")
    text = text.replace("12.5\n", "1.226+5\n").replace(
        "11              2.5 ", "11              2.452+4 "
    )
    text = text.replace("PARAM   POST    -1", "PARAM,WTMASS,1.0197-4")
    plain, weighed = (mesh_building(load_building(write(tmp_path, t))) for t in (FRAME, text))
    np.testing.assert_allclose(frequencies(weighed), frequencies(plain), rtol=1e-3)


def test_soft_diagonals_are_infills_where_the_user_says_so(tmp_path):
    write(tmp_path, FRAME.replace("2.1+5", "4.0+3"))  # a brace of masonry
    draft = draft_text(tmp_path / "frame.bdf", "N,mm", tmp_path)
    path = tmp_path / "frame.toml"
    for kind in ("brace", "infill"):
        path.write_text(draft.replace("# infills", "# " if kind == "brace" else "infills"))
        mesh = mesh_building(load_building(path))
        kinds = {str(name) for block in mesh.model.elements for name in block.kind}
        assert kinds & {"brace", "infill"} == {kind}
    assert "diagonals softer than mesh.infills" in " ".join(mesh.notes)


def test_a_card_may_be_left_out_on_the_users_word(tmp_path):
    write(tmp_path, FRAME.replace("CROD    15", "CTETRA  15"))
    draft = draft_text(tmp_path / "frame.bdf", "N,mm", tmp_path)
    own = tmp_path / "frame.toml"
    own.write_text(draft.replace("# ignore", "ignore"))
    mesh = mesh_building(load_building(own))
    assert "1 CTETRA" in " ".join(mesh.notes)
    own.write_text(draft.replace('force = "N"\n', ""))
    with pytest.raises(BuildingError, match=r"mesh\.force: the key is missing"):
        load_building(own)


def test_what_swings_freely_is_called_as_in_the_deck(tmp_path):
    rod = "GRID,31,,0.,0.,7500.\nCROD,32,5,9,31\nCBEAM   5"
    path = write(tmp_path, FRAME.replace("CBEAM   5", rod))
    with pytest.raises(StructureError, match=r"GRID 31 at \(0, 0, 7\.5\) m moves along ux"):
        frequencies(mesh_building(load_building(path)))


def column(*cards, up=(1.0, 0.0, 0.0), ends=""):
    """A cantilever of 6 m with a mass on top, in N and m; its bars have the property 1."""
    nodes = [f"GRID,{k},,0.,0.,{1.5 * k}" for k in range(5)]
    nodes[0] = "GRID,5,,0.,0.,0."
    numbers = [5, 1, 2, 3, 4]
    way = ",".join(map(str, up))
    bars = [
        f"CBAR,{k + 1},1,{numbers[k]},{numbers[k + 1]},{way},{ends if k == 3 else ''}"
        for k in range(4)
    ]
    fixed = () if any("SPC" in card for card in cards) else ("SPC1,1,123456,5",)
    usual = ("MAT1,1,3.+10,,.2,2500.", "CONM2,90,4,,4000.", *fixed)
    return "\n".join(["BEGIN BULK", *nodes, *bars, *usual, *cards])


BAR = "PBARL,1,1,,BAR,,,,,\n+,.3,.5"
TURN = np.deg2rad(30.0)
STRONG, WEAK = 0.3 * 0.5**3 / 12.0, 0.5 * 0.3**3 / 12.0
AREA, TORSION = 0.15, 0.0028
TURNED = (
    STRONG * np.cos(TURN) ** 2 + WEAK * np.sin(TURN) ** 2,
    STRONG * np.sin(TURN) ** 2 + WEAK * np.cos(TURN) ** 2,
    (STRONG - WEAK) * np.sin(TURN) * np.cos(TURN),
)
PLAIN = f"PBAR,1,1,{AREA},{STRONG:.9E},{WEAK:.9E},{TORSION}\n+\n+"
SKEW = f"PBAR,1,1,{AREA},{TURNED[0]:.9E},{TURNED[1]:.9E},{TORSION}\n+\n+,,,{TURNED[2]:.9E}"
# Two decks of one column, whose frequencies agree.
ALIKE = {
    "a product of inertia": (
        column(SKEW),
        column(PLAIN, up=(float(np.cos(TURN)), float(np.sin(TURN)), 0.0)),
    ),
    "PBEAM": (
        column(PLAIN + ",10.,10."),
        column(PLAIN + ",10.,10.")
        .replace("CBAR", "CBEAM")
        .replace(PLAIN, f"PBEAM,1,1,{AREA},{STRONG:.9E},{WEAK:.9E},0.,{TORSION}\n+\n+"),
    ),
    "PBEAML": (column(BAR), column(BAR.replace("BARL", "BEAML")).replace("CBAR", "CBEAM")),
    "a reference node": (
        column(BAR, "GRID,9,,5.,0.,0."),
        re.sub(r"1.0,0.0,0.0,", "9,,,", column(BAR, "GRID,9,,5.,0.,0.")),
    ),
    "mass per length": (
        column(PLAIN).replace("2500.", "0.").replace(f"{TORSION}", f"{TORSION},375."),
        column(PLAIN),
    ),
    "G in place of nu": (column(BAR), column(BAR).replace("3.+10,,.2", "3.+10,1.25+10,")),
    "another system": (
        column(BAR, "CORD2R,3,,0.,0.,0.,0.,0.,1.\n+,0.,1.,0."),
        column(BAR, "CORD2R,3,,0.,0.,0.,0.,0.,1.\n+,0.,1.,0.")
        .replace("GRID,5,,0.,0.,0.", "GRID,5,3,0.,0.,0.,3")
        .replace("5,1,1.0,0.0,0.0", "5,1,0.0,-1.0,0.0"),
    ),
    "a cylindrical system": (
        column(BAR, "GRID,8,,3.,4.,6.", "CONROD,70,4,8,1,.01", "SPC1,1,123456,5,8"),
        column(
            BAR,
            "CORD2C,4,,0.,0.,6.,0.,0.,9.\n+,2.,0.,6.",
            f"GRID,8,4,5.,{np.rad2deg(np.arctan2(4.0, 3.0)):.9f},0.,4",
            "CROD,70,2,4,8",
            "PROD,2,1,.01",
            "SPC1,1,123456,5,8",
        ),
    ),
    "a spherical system": (
        column(BAR).replace("90,4,,4000.", "90,4,,4000.,0.,3.,4."),
        column(BAR, "CORD2S,4,,0.,0.,6.,0.,0.,9.\n+,2.,0.,6.", "RBAR,80,4,7,123456")
        .replace("90,4,", "90,7,")
        .replace("GRID,1,", f"GRID,7,4,5.,{np.rad2deg(np.arctan2(3.0, 4.0)):.9f},90.\nGRID,1,"),
    ),
    "what cards have in common": (
        column(BAR, "CORD1R,3,5,4,9", "GRID,9,,5.,0.,0."),
        column(BAR, "CORD1R,3,5,4,9", "GRID,9,,5.,0.,0.", "GRDSET,,,,,,,,0", "BAROR,,1,,,1.,0.,0.")
        .replace(",1,5,1,1.0,0.0,0.0", ",,5,1")
        .replace("3,4,1.0,0.0,0.0", "3,4"),
    ),
    "springs by properties": (
        column(BAR, "$SPC", *(f"CELAS2,{60 + k},{k}.+7,5,{k}" for k in range(1, 7))),
        column(
            BAR, "$SPC", "CBUSH,60,6,5,,,,,0", "PBUSH,6,K,1.+7,2.+7,3.+7,0.,0.,0.", "PELAS,7,4.+7"
        )
        .replace("PELAS,7,4.+7", "PELAS,7,4.+7,,,8,5.+7\nPELAS,9,6.+7\n")
        .replace("9,6.+7\n", "9,6.+7\nCELAS1,61,7,5,4\nCELAS1,62,8,5,5\nCELAS1,63,9,5,6"),
    ),
    "sets that are added": (
        column(BAR),
        column(BAR, "SPC1,2,123,5", "SPC,3,5,456,0.", "SPCADD,9,2,3"),
    ),
    "constraints of a node": (
        column(BAR),
        column(BAR, "SPCX").replace("\nSPCX", "").replace("5,,0.,0.,0.", "5,,0.,0.,0.,,123456"),
    ),
    "springs": (
        column(BAR),
        column(BAR, "$SPC", *(f"CELAS2,{60 + k},1.+15,5,{k}" for k in range(1, 7))),
    ),
    "a rigid link to the mass": (
        column(BAR).replace("90,4,,4000.", "90,4,,4000.,0.,0.,.5"),
        column(BAR, "GRID,7,,0.,0.,6.5", "RBE2,80,4,123456,7").replace("90,4,", "90,7,"),
    ),
    "offsets of both ends": (
        column(BAR),
        column(BAR, "GRID,7,,1.,0.,0.", "RBE2,80,5,123456,7", "SPC1,1,123456,5").replace(
            "CBAR,1,1,5,1,1.0,0.0,0.0,",
            "CBAR,1,1,7,1,1.0,0.0,0.0,,\n+,,,-1.,0.,0.",
        ),
    ),
}


# Area and second moments that MYSTRAN 18.0.0.1 prints of sections (2026-11-26).
SHAPES = {
    "TUBE,,,,,\n+,.2,.15": (5.4978e-2, 8.5903e-4, 8.5903e-4),
    "BOX,,,,,\n+,.3,.5,.02,.015": (2.58e-2, 9.3494e-4, 3.7048e-4),
    "I,,,,,\n+,.5,.3,.4,.02,.03,.04": (3.36e-2, 1.41e-3, 2.8112e-4),
    "I1,,,,,\n+,.28,.02,.44,.5": (2.68e-2, 1.1374e-3, 1.3529e-4),
    "H,,,,,\n+,.44,.06,.3,.02": (2.68e-2, 1.3529e-4, 1.1374e-3),
    "CHAN,,,,,\n+,.2,.5,.02,.03": (2.08e-2, 8.0557e-4, 8.1416e-5),
    "CHAN1,,,,,\n+,.18,.02,.44,.5": (2.08e-2, 8.0557e-4, 8.1416e-5),  # whose I2 it has wrong
    "T,,,,,\n+,.6,.5,.1,.2": (0.14, 3.2595e-3, 2.0667e-3),
    "T1,,,,,\n+,.5,.28,.02,.03": (1.84e-2, 2.0896e-4, 1.5793e-4),
    "CROSS,,,,,\n+,.28,.02,.5,.03": (1.84e-2, 2.0896e-4, 6.7813e-5),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_sections_have_the_figures_of_another_program(shape, tmp_path):
    mesh = mesh_building(load_building(write(tmp_path, column(f"PBARL,1,1,,{shape}")), "N,m"))
    (bars,) = mesh.model.elements
    figures = (bars.area[0], bars.inertia_y[0], bars.inertia_z[0])
    np.testing.assert_allclose(figures, SHAPES[shape], rtol=1e-4)


@pytest.mark.parametrize("case", ALIKE)
def test_two_ways_of_saying_the_same_agree(case, tmp_path):
    expected, found = (
        frequencies(mesh_building(load_building(write(tmp_path, text), "N,m")), 5)
        for text in ALIKE[case]
    )
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_a_pin_and_a_soft_plate_do_what_they_say(tmp_path):
    # A bar that turns freely under the mass holds it like the three below it alone.
    stiff, pinned = (
        mesh_building(load_building(write(tmp_path, column(BAR, ends=pins)), "N,m"))
        for pins in ("", ",\n+,,456")
    )
    assert not any(block.released is not None for block in stiff.model.elements)
    np.testing.assert_allclose(frequencies(pinned, 2), frequencies(stiff, 2), rtol=1e-2)
    plate = ["BEGIN BULK", "MAT1,1,3.+10,,.2,2500.", "PSHELL,1,1,.2,1,1.0", "SPC1,1,123456,1,2"]
    plate += [f"GRID,{2 * k + s},,{s - 1}.,0.,{0.5 * k}" for k in range(9) for s in (1, 2)]
    plate += [f"CQUAD4,{k},1,{2 * k - 1},{2 * k},{2 * k + 2},{2 * k + 1}" for k in range(1, 9)]
    plate += ["CBAR,99,2,17,18,0.,0.,1.", "PBARL,2,1,,ROD,,,,,\n+,.01"]
    text = "\n".join(plate)
    whole, soft = (
        frequencies(mesh_building(load_building(write(tmp_path, t), "N,m")), 1)[0]
        for t in (text, text.replace("1,1.0", "1,.25"))
    )
    assert soft == pytest.approx(0.5 * whole, rel=0.01)


def test_a_deck_is_inspected_drafted_and_cut(tmp_path):
    path = write(tmp_path, FRAME)
    broken = tmp_path / "broken.nas"
    broken.write_text("BEGIN BULK\n")
    report = inspect(path, broken)
    assert [deck for deck, *_ in report.models] == [path]
    assert "Units N and mm" in " ".join(report.lines())
    assert report.refused[0].startswith("broken.nas: it has no GRID")
    write(tmp_path, FRAME.replace("2.5-9", "0.").replace("7.85-9", "0."))
    assert " --units FORCE,LENGTH --draft frame.toml" in "".join(inspect(path).lines())
    write(tmp_path, FRAME)
    draft = write_draft(path, None, tmp_path / "own" / "mine.toml")
    building = load_building(draft)
    np.testing.assert_allclose(building.floor_levels, [3.0, 6.0])
    chosen = choose_members(building, ["W1:S1", (0.0, 0.0, 1.5)])
    assert [member.kind for member in chosen.members] == ["wall", "column"]
    rows = chosen.rows(np.ones(2))
    assert all(np.abs(row).max() > 0.0 for row in rows)
