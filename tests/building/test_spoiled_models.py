"""Spoiled models of other programs: one sentence each with file, line and cure."""

import json
import re

import numpy as np
import pytest

from femupdate.building import load_building, mesh_building
from femupdate.building.model_files import write_draft
from femupdate.errors import BuildingError, FemupdateError
from femupdate.interface import build_model
from tests.building.csi_texts import etabs, sap2000
from tests.building.test_deck import ALIKE, FRAME, mass

STEEL = {"E": 2.1e8, "G": 8.1e7, "A": 0.01, "Jx": 1e-5, "Iy": 1e-4, "Iz": 1e-4}
BEAM = {"type": "ElasticBeam3d", **STEEL, "massperlength": 0.1, "crdTransformation": "1"}
NODES = [(1, 0, 0, 0), (2, 4, 0, 0), (3, 0, 0, 3), (4, 4, 0, 3), (9, 2, 0, 3)]
OPENSEES = {
    "StructuralAnalysisModel": {
        "properties": {
            "uniaxialMaterials": [
                {"name": "1", "type": "ElasticMaterial", "Epos": 2.1e8},
                {"name": "2", "type": "Steel01", "E": 2.1e8, "fy": 3e5, "b": 0.01},
            ],
            "ndMaterials": [],
            "sections": [
                {"name": "5", "type": "ElasticSection3d", **STEEL},
                {"name": "6", "type": "LayeredShell", "thickness": 0.2},
            ],
            "crdTransformations": [
                {"name": "1", "type": "LinearCrdTransf3d", "vecInLocXZPlane": [0, 1, 0]}
            ],
        },
        "geometry": {
            "nodes": [
                {"name": n, "ndf": 6, "crd": list(at)}
                | ({"mass": [9, 9, 0, 0, 0, 1]} if n == 9 else {})
                for n, *at in NODES
            ],
            "elements": [
                {"name": 1, "nodes": [1, 3], **BEAM},
                {"name": 2, "nodes": [2, 4], **BEAM},
                {"name": 3, "nodes": [3, 4], **BEAM},
                {"name": 4, "type": "Truss", "nodes": [1, 4], "A": 1e-3, "material": "1"},
            ],
        },
    }
}
BESIDE = """\
name = "model"
kind = "mesh"
mesh = {{ file = "{file}", unit = "m", force = "kN", diaphragms = "*", mass = "lumped" }}
supports.base = "fixed"
stories = [{{ name = "S1", height = "3 m" }}]
sensors = {{ direction = "x", points = [["0 m", "0 m"]] }}
frequency_grid = {{ start = "0.1 Hz", step = "0.1 Hz", count = 100 }}
prior.theta = {{ lower = 0.5, upper = 2 }}
damping = {{ law = "constant", ratio = 0.02 }}
"""
WHOLE = {
    "bdf": FRAME,
    "json": json.dumps(OPENSEES, indent=1),
    "s2k": sap2000(),
    "e2k": etabs(),
}

# What is written in place of what, and the complaint (None: it is read all the same).
SPOILED = {
    "bdf: unknown element": ("CROD    15", "CTETRA  15", r"line 34: CTETRA 15: .*mesh\.ignore"),
    "bdf: missing property": ("CBAR    4       1 ", "CBAR    4       6 ", "no property 6; add"),
    "bdf: of a plate": ("CBAR    4       1 ", "CBAR    4       3 ", "property 3 is a PSHELL; name"),
    "bdf: orthotropic": ("MAT1    1 ", "MAT8    1 ", "material 1 is a MAT8; name a MAT1, alike"),
    "bdf: replicated": ("CBAR    2 ", "=       * ", "line 23: =: .* are not read: write them out"),
    "bdf: missing node": ("14,3,1,2,6,5", "14,3,1,2,6,55", "no GRID 55; add it"),
    "bdf: negative spring": ("GRID,99", "CELAS2,77,-5.,12,1\nGRID,99", "77: its stiffness is neg"),
    "bdf: double node": ("GRID,99", "GRID,12", "line 20 has this number already"),
    "bdf: ring of axes": ("CORD2R  9       ", "CORD2R  9       9", "in a circle .9 to 9.; correct"),
    "bdf: missing system": ("GRID    12      9", "GRID    12      8", "no CORD2R 8; add it"),
    "bdf: flat system": ("+       1000.", "+       0.   ", "lie on one line"),
    "bdf: no number": ("GRID    6               4000.", "GRID    6               4o00.",
        "'4o00.'; write"),
    "bdf: no support": ("SPC1    7 ", "$PC1    7 ", "sets 8, and SPC = 7 in case"),
    "bdf: two sets": ("SPC = 7\n", "", "sets 7, 8.*write SPC ="),
    "bdf: double element": ("CBAR    2 ", "CBAR    1 ", "line 22 has this number already"),
    "bdf: two supports": ("SPC = 7\n", "SUBCASE 1\n SPC = 7\nSUBCASE 2\n SPC = 8\n",
        "SPC = 7 and 8; keep"),
    "bdf: negative area": ("1.2+5", "-1.2+5", "area must be positive"),
    "bdf: no orientation": ("1       5       0.      1.", "1       5       0.      0.", "give X1"),
    "bdf: loose part": ("CBEAM   ", "$BEAM   ", r"hangs? free, such as the \d+ nodes around 9 at"),
    "bdf: hanging node": ("CROD    15",
        "GRID,13,,2.+3,0.,3.+3\nGRID,14,,2.+3,0.,5.+3\nCTRIA3,31,3,5,13,14\nCROD    15",
        "node 13 .* lies on the side between nodes 5 and 6"),
    "bdf: crossed shell": ("6       7       8\n", "7       6       8\n", "do not go around it"),
    "bdf: unknown section": ("BAR      ", "HAT      ", "'HAT' is none of"),
    "bdf: membrane": ("200.    1       1.", "200.            1.", "give MID1 and MID2"),
    "bdf: hanging mass": ("CONM2   21      9 ", "CONM2   21      99", "carries nothing; join it"),
    "bdf: no name": ("GRID,99", "-RID,99", "begin the line with"),
    "bdf: another continuation": ("+       300.", "+B      300.", None),
    "bdf: a stray continuation": ("GRID,99", "+B,2,2\nGRID,99", "asks for none; put"),
    "bdf: free to turn": ("CBAR    1       1       1       5       0.      1.      0.",
        "CBAR,1,1,1,5,0.,1.,0.\n+,4,4", "CBAR 1: it is released so far .* freely; keep"),
    "bdf: y is up": ("1       THRU    4", "1       2       5       6       9       10",
        "in one upright plane, as if y were up; turn"),
    "bdf: far too many fields": ("1.,1.,1.", "1.,1.,1.,,,,,,,5", "fields are more"),
    "bdf: a ring of links": ("GRID,99", "RBE2,31,5,123,6\nRBE2,32,6,123,5\nGRID,99",
        "line 22: RBE2 32: GRID 5 follows itself, .*; tie"),
    "bdf: a held follower": ("GRID,99", "RBE2,31,5,123,1\nGRID,99",
        "line 21: RBE2 31: GRID 1 follows it and is held by a support; remove"),
    "bdf: an empty link": ("GRID,99", "RBE2,31,5,123\nGRID,99", "it ties nothing; give"),
    "bdf: a corner twice": ("6       7       8\n", "6       7       7\n",
        "line 30: CQUAD4 11: it has 3 distinct corners; divide"),
    "bdf: include": ("PARAM   POST    -1", "INCLUDE 'x.bdf'", "no file x.bdf; put it"),
    "bdf: included in a circle": ("PARAM   POST    -1", "INCLUDE model.bdf", "includes itself"),
    "bdf: not plain": ("$ columns", "\x00", "no plain text"),
    "bdf: no mass unit": ("PARAM   POST    -1", "PARAM   WTMASS  0.", "PARAM WTMASS: .* positive"),
    "bdf: comment in latin-1": ("$ columns", "$ Stützen", None),
    "bdf: no ENDDATA": ("ENDDATA", "", None),
    "bdf: nothing": (FRAME, "BEGIN BULK\nENDDATA\n", "it has no GRID"),
    "json: cut off": ('"geometry"', "", r"line \d+: this is no JSON; write"),
    "json: nothing": (WHOLE["json"], "{}", "there are no nodes or elements"),
    "json: other kind": ('"Truss"', '"Joint3D"', r"line \d+: Joint3D 4: 1 elements Joint3D have"),
    "json: one node": ("[\n      3,\n      4\n", "[\n      3\n", "it has 1 nodes; give it two"),
    "json: missing material": ('"material": "1"', '"material": "7"', "no 7 in uniaxialMaterials"),
    "json: nonlinear": ('"material": "1"', '"material": "2"', r'mesh.elastic = \["Steel01"\]'),
    "json: missing transformation": ('"crdTransformation": "1"', '"crdTransformation": "3"',
        "no 3 in crd"),
    "json: a plane model": ('"crd": [\n      0,', '"crd": [', "must have -ndm 3"),
    "json: no number": ('"A": 0.001', '"A": "big"', "A is 'big'; print"),
    "json: no type": ('"type": "Truss"', '"typ": "Truss"', "elements 4: it has no type; print"),
    "json: double node": ('"name": 2,\n     "ndf"', '"name": 1,\n     "ndf"',
        "another node of this name"),
    "json: binary": ("{", "\x00{", "no plain text"),
    "s2k: no joints": ("JOINT COORDINATES", "JOINT COORDINATE",
        "no table JOINT COORDINATES; export"),
    "s2k: two units": ('CurrUnits="KN, m, C"', 'CurrUnits="KN, m, C"\n   CurrUnits="Kip, ft, F"',
        "units KN, m, C and Kip, ft, F; export"),
    "s2k: unknown units": ("KN, m, C", "KN, yd, C", "'yd' are not known; export"),
    "s2k: unknown table": ('"GRID LINES"', '"CONNECTIVITY - LINK"',
        r"line \d+: CONNECTIVITY - LINK GLOBAL: .*; replace"),
    "s2k: missing joint": ("JointI=99", "JointI=98", "there is no joint 98; add"),
    "s2k: two corners": ("NumJoints=4   Joint1=11   Joint2=12   Joint3=13   Joint4=14",
        "NumJoints=2   Joint1=11   Joint2=12", "has 2 corners; give it three"),
    "s2k: double joint": ("Joint=99   CoordSys=GLOBAL   CoordType",
        "Joint=1   CoordSys=GLOBAL   CoordType", "has this name already; rename"),
    "s2k: missing system": ("Joint=99   CoordSys=GLOBAL", "Joint=99   CoordSys=CS1",
        "no system CS1; add"),
    "s2k: no number": ("XorR=2.5", "XorR=two", "XorR is 'two'; write a number"),
    "s2k: decimal comma": ("XorR=2.5", "XorR=2,5", None),
    "s2k: no supports": ("JOINT RESTRAINT ASSIGNMENTS", "LOAD CASE 9", "no node is held; add"),
    "s2k: membrane in the air": ("Joint=13   Constraint=D1", "Joint=99   Constraint=D1",
        "in no rigid diaphragm; assign one"),
    "s2k: modifiers by direction": ("F11Mod=.5", "F11Mod=.4", "differ by direction.*; give f11"),
    "s2k: long end offsets": ("RigidFactor=0.5", "RigidFactor=9", "leave nothing of it; shorten"),
    "s2k: unknown shape": ("Shape=Rectangular   t3=0.6", "Shape=Angle   t3=0.6",
        "'Angle' is not known.*; give its"),
    "s2k: layered": ("Type=Shell-Thin", "Type=Shell-Layered", "have no counterpart; use a shell"),
    "s2k: no key": ("   Joint=99   CoordSys", "   what\n   Joint=99   CoordSys",
        "no key=value; export"),
    "s2k: lost load": ("Frame=5   LoadPat", "Frame=50   LoadPat", "no frame 50; add it"),
    "s2k: cut off": ("END TABLE DATA", "", "without END TABLE DATA.*; export"),
    "s2k: a plane": ('TABLE:  "GRID', 'TABLE:  "ACTIVE DEGREES OF FREEDOM"\n   UX=Yes   UY=No\n'
        'TABLE:  "GRID', "ACTIVE .*; make all six active"),
    "s2k: orthotropic": ("E1=30000000", "E1=30000000   E2=1000", "differs by direction.*; make it"),
    "s2k: latin-1": ("GridID=A", "GridID=Ä", None),
    "s2k: UTF-16": ("TABLE", "T\x00A\x00", r"line \d+: this is no plain text"),
    "s2k: neither yes nor no": ("U1=Yes", "U1=Maybe", "U1 is 'maybe'; write Yes or No"),
    "s2k: part of a load": ("RelDistA=0 ", "RelDistA=.5 ", None),
    "e2k: no stories": ("STORY ", "STOREY ", "no STORY or no POINT; export"),
    "e2k: two units": ('  UNITS  "KN"  "M"  "C"', '  UNITS  "KN"  "M"  "C"\n  UNITS "N" "MM" "C"',
        "two systems of units; export"),
    "e2k: missing point": ('BEAM "5"', 'BEAM "6"',
        r"line \d+: LINEASSIGN B5: there is no POINT 6; add"),
    "e2k: missing line": ('LINEASSIGN "B5"', 'LINEASSIGN "B6"', "no LINE B6; add"),
    "e2k: no material": ('"COL"  MATERIAL "C30"', '"COL"  MATERIAL "C40"', "no material C40; add"),
    "e2k: unknown restraint": ("UX UY UZ RX", "UXX UY UZ RX", "UXX is not known; write some of"),
    "e2k: negative height": ("HEIGHT 3 ", "HEIGHT -3 ", "STORY Story2: HEIGHT -3 is negative; w"),
    "e2k: a link": ('"C1" COLUMN', '"C1" LINK', "a LINK has no counterpart; draw"),
    "e2k: below the base": ('"1" "1" 1', '"1" "1" 3', "reaches below Base; correct"),
    "e2k: a hinge": ("$ LOAD PATTERNS", '  HINGEASSIGN "B1" "Story1"', "HINGEASSIGN have no.*; re"),
    "e2k: all directions": ("$ LOAD PATTERNS", '  ACTIVEDOF "UX UY UZ RX RY RZ"', None),
    "e2k: unknown release": ('"M2I M3I M2J M3J"', '"M9"', "'M9' is not known; write"),
    "e2k: a spring": ('DIAPH "DISCONNECTED"', 'SPRINGPROP "S1"', "has no counterpart; hold it"),
    "e2k: library section": ('SHAPE "Concrete Rectangular"  D 0.5  B 0.4', 'SHAPE "W14X90"',
        "'W14X90' is not known.*; give"),
    "e2k: semirigid": ("TYPE RIGID", "TYPE SEMIRIGID", "in no rigid diaphragm; assign"),
    "e2k: a floor of five corners": ('MODELINGTYPE "Membrane"', 'MODELINGTYPE "ShellThin"', None),
}  # fmt: skip


@pytest.mark.parametrize("case", SPOILED)
def test_a_spoiled_model_is_told_in_one_sentence(case, tmp_path):
    old, new, message = SPOILED[case]
    ending = case.partition(":")[0]
    assert old in WHOLE[ending]
    path = tmp_path / f"model.{ending}"
    path.write_text(WHOLE[ending].replace(old, new), encoding="latin-1")
    units, model = ("N,mm" if ending == "bdf" else None), path
    if ending == "json":
        model = tmp_path / "model.toml"
        model.write_text(BESIDE.format(file=path.name))
    if message is None:
        load_building(model, units)
        return
    with pytest.raises(BuildingError, match=message) as caught:
        load_building(model, units)
    text = str(caught.value)
    assert path.stem in text
    assert "\n" not in text
    assert re.search(r"; \w", text), text  # the cure
    draft = tmp_path / "draft.toml"
    try:
        write_draft(path, "kN,m" if ending == "json" else units, draft)
    except BuildingError:
        assert [file.name for file in tmp_path.glob("*draft*")] == []


@pytest.mark.parametrize("case", ["bdf: free", "json: free", "bdf: unknown"])
def test_a_draft_stays_where_it_asks_for_something(case, tmp_path):
    """A mechanism leaves no draft; what OpenSees does not say or is to be ignored is said there."""
    ending = case.partition(":")[0]
    free, link = ("SPC1    7       123456", "SPC1    7       3     "), "RBE3,31,,5,123,1.,123,6,7\n"
    old, new = free if "free" in case else ("GRID,99", f"{link}GRID,99")
    model = tmp_path / f"model.{ending}"
    model.write_text(WHOLE[ending].replace(old, new))
    units, draft = ("N,mm" if ending == "bdf" else "kN,m"), tmp_path / "draft.toml"
    with pytest.raises(FemupdateError):
        build_model(tmp_path / "study", model, units=units, draft=draft)
    assert draft.exists() is (case != "bdf: free")
    assert not (tmp_path / "study" / "building.toml").exists()


def counted(text, ending):
    """Entries of a file, counted by another way than the readers'."""
    if ending == "json":
        whole = json.loads(text)["StructuralAnalysisModel"]["geometry"]
        return len(whole["nodes"]) + len(whole["elements"])
    text = text.partition("BEGIN BULK")[2] or text
    entry = {"bdf": r"^[A-Z](?!NDDATA)", "s2k": r"^   \w", "e2k": r"^ *[A-Z]"}[ending]
    return len(re.findall(entry, text, re.M))


DECKS = {f"model.{ending}": (text, ending) for ending, text in WHOLE.items()}
DECKS |= {
    f"{case} {k}": (text, "bdf") for case, pair in ALIKE.items() for k, text in enumerate(pair)
}


@pytest.mark.parametrize("deck", DECKS)
def test_nothing_is_dropped_in_silence(deck, tmp_path):
    """Entries of the file are taken or named, and its mass is that of the model."""
    text, ending = DECKS[deck]
    path = model = tmp_path / f"model.{ending}"
    path.write_text(text)
    if ending == "json":
        model = tmp_path / "model.toml"
        model.write_text(BESIDE.format(file=path.name))
    units = {"model.bdf": "N,mm"}.get(deck, "N,m" if ending == "bdf" else None)
    mesh = mesh_building(load_building(model, units))
    told = " ".join(note[:-1] for note in mesh.notes if note.startswith(("Taken", "Left")))
    named = re.findall(r"[:,] (\d+) (?!key )", told)
    assert sum(map(int, named)) == counted(text, ending), told
    masses = re.search(r"file (\S+) t, of the model (\S+) t", " ".join(mesh.notes)).groups()
    draft = write_draft(path, "kN,m" if ending == "json" else units, tmp_path / "draft.toml")
    text = draft.read_text().replace("# [supports]\n# base", "[supports]\nbase")
    draft.write_text(re.sub("# (diaphragms|mass) =", r"\1 =", text))  # what OpenSees does not say
    drafted = mass(mesh_building(load_building(draft)))
    np.testing.assert_allclose([*(1e3 * np.array(masses, float)), drafted], mass(mesh), rtol=1e-3)
