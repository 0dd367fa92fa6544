"""Every wrong file ends in one sentence that names the file, the key and the mend."""

import re
import time

import pytest

from femupdate.building import building_text, from_document, load_building
from femupdate.errors import BuildingError
from tests.building.frames import SMALL
from tests.documents import stick

ZETA = "[prior.zeta]\nlower = 0.01\nupper = 0.05\n"
FIXED = '[supports]\nbase = "fixed"\n'

INFILL = """[[infills]]
along = "P"
from = "A"
to = "B"
thickness = "200 mm"
formula = "FEMA 356"
material = "concrete"

"""


def springs(table):
    """A file with springs to the ground."""
    return "[[slabs]]", f"[[springs]]\n{table}\n\n[[slabs]]"


CASES = {
    "spring under no column": ('[[columns]]\nsection = "column"\n',
        '[[springs]]\nat = ["A-P", "C-P"]\nkx = "1 kN/mm"\n\n[[columns]]\nsection = "column"\n'
        'at = ["A-P", "A-Q", "B-P", "B-Q"]\n',
        r"springs\[0\]\.at\[1\]: no column stands on the base at C-P; name another"),
    "spring outside of the building": (
        *springs('points = [["30 m", "0 m", "0 m"]]\nkx = "1 kN/mm"'),
        r"springs\[0\]\.points\[0\]: \(30, 0, 0\) m lies outside of the building",
    ),
    "spring of no stiffness": (*springs('at = "*"'), r"springs\[0\]\.kx: give a stiffness, one of"),
    "dashpot without a spring": (*springs('kx = "1 kN/mm"\ncy = "5 kN s/m"'),
        r"springs\[0\]\.cy: a dashpot needs a spring beside it; give ky or remove it"),
    "springs at columns and at points": (
        *springs('at = "A-P"\npoints = [["0 m", "0 m", "0 m"]]\nkx = "1 kN/mm"'),
        r"springs\[0\]\.points: give either columns \(at\) or points",
    ),
    "springs under a base on springs": ("[[slabs]]",
        '[supports]\nbase = "springs"\nkx = "1000 MN/m"\n\n'
        '[[springs]]\nkx = "1 kN/mm"\n\n[[slabs]]',
        r"springs: they stand on a base that is \"fixed\" or \"pinned\", not 'springs'"),
    "isolators of one newton": (
        '[[walls]]\nalong = "P"\nfrom = "A"\nto = "B"\nthickness = "150 mm"',
        '[[springs]]\nkx = "1 N/m"',
        r"springs\[0\]\.kx: the whole building would move at 0.0.* Hz on its springs",
    ),
    "infill in a bay without a column": ('[[columns]]\nsection = "column"\n',
        f'{INFILL}[[columns]]\nsection = "column"\nat = ["A-P", "C-P", "A-Q", "B-Q", "C-Q"]\n',
        r"infills\[0\]\.to: no column stands at B-P in story low; end the infill at columns"),
    "infill twice": ("[[slabs]]", f"{INFILL}{INFILL}[[slabs]]",
        r"infills\[1\]: it lies on infills\[0\] at"),
    "infill between members that fill the bay": (
        '[sections.column]\nshape = "rectangle"\nwidth = "300 mm"',
        f'{INFILL}[sections.column]\nshape = "rectangle"\nwidth = "4 m"',
        r"infills\[0\]: beams and columns leave nothing of the bay A to B in story low",
    ),
    "rigid ends longer than a column": ('[[columns]]\nsection = "column"',
        '[[columns]]\nsection = "column"\nrigid_ends = ["1 m", "1.8 m"]',
        r"columns\[0\]\.rigid_ends: they leave nothing of story high, 2.8 m high; shorten them"),
    "modulus of concrete in MPa": ('"25 GPa"', '"28 MPa"',
        "materials.concrete.youngs_modulus: 0.028 GPa is no concrete, of which 10 to 60 GPa are"),
    "story of 2800 m": ('"2.8 m"', '"2800 m"',
        "stories: high is 2800 m high: is the unit wrong. Correct its height"),
    "springs of one newton": ("[mesh]", '[supports]\nbase = "springs"\nkx = "1 N/m"\n\n[mesh]',
        "supports.kx: the whole building would move at 0.0.* Hz on its springs"),
    "path with backslashes": ('name = "small"', 'name = "C:\\temp"',
        "name: 'C:.temp' is not what was meant: TOML reads a backslash .*write / or single quotes"),
    "path that is no TOML": ('name = "small"', 'name = "C:\\models"',
        "this is not valid TOML: Unescaped .*in double quotes a backslash starts a special"),
    "no kind": ('kind = "frame"\n', "", "kind: the key is missing"),
    "wrong kind": ('"frame"', '"fram"', "kind: 'fram' is not a kind.*did you mean 'frame'"),
    "unknown key": ('thickness = "150 mm"\n\n[[walls]]', 'thicknes = "150 mm"\n\n[[walls]]',
        r"walls\[0\]\.thicknes: unknown key; did you mean 'thickness'\?"),
    "factors by kind": ("[damping]", '[parameters]\nby = ["story", "kind"]\n\n[damping]',
        "parameters: every story has one stiffness factor; remove the table"),
    "unknown key without a likeness": ("[damping]", "[damping]\nxyz = 1",
        "damping.xyz: unknown key; the known ones are"),
    "missing key": ('height = "2.8 m"\n', "", r"stories\[1\]\.height: the key is missing; add it"),
    "no grid": ("[frequency_grid]", "[provenance]", "frequency_grid: .*missing; add .*0.1 Hz"),
    "two tables missing": (SMALL[SMALL.index("[frequency_grid]"):], "",
        'frequency_grid: .*missing; .*; damping: .*missing; add .*ratio = 0.02, say$'),
    "missing unit": ('"2.8 m"', "2.8", r"stories\[1\]\.height: 2.8 has no unit.*such as \"1.5 m\""),
    "wrong unit": ('"25 GPa"', '"25 m"',
        "materials.concrete.youngs_modulus: unknown unit 'm' for stress; use one of Pa, kPa"),
    "negative": ('thickness = "100 mm"', 'thickness = "-100 mm"',
        r"walls\[1\]\.thickness: '-100 mm' is not a positive length"),
    "mesh too fine": ('size = "1 m"', 'size = "1 mm"', "mesh.size: .*nodes; write a larger size"),
    "not a number": ("ratio = 0.02", "ratio = nan", "damping.ratio: nan is not a finite number"),
    "per cent for a ratio": ("ratio = 0.02", "ratio = 2", "damping.ratio: 2 must lie below 1"),
    "count of one": ("count = 300", "count = 1", "frequency_grid.count: 1 must lie between"),
    "text for a flag": ('role = "non_structural"', 'stiffness = "no"',
        r"walls\[1\]\.stiffness: 'no' must be true or false"),
    "unknown role": ('"non_structural"', '"partition"',
        r"walls\[1\]\.role: 'partition' is not known; write one of 'shear' or"),
    "opening beyond the wall": ('thickness = "150 mm"\n\n[[walls]]',
        'thickness = "150 mm"\nopenings = [{ left = "3 m", width = "1.5 m", bottom = "0 m", '
        'height = "1 m" }]\n\n[[walls]]',
        r"walls\[0\]\.openings\[0\]\.width: the opening ends 4.5 m from A, the wall at 4 m"),
    "opening higher than one story": ('thickness = "150 mm"\n\n[[walls]]',
        'thickness = "150 mm"\nopenings = [{ left = "1 m", width = "1 m", bottom = "2 m", '
        'height = "1 m" }]\n\n[[walls]]',
        r"walls\[0\]\.openings\[0\]\.height: .*story high at 2.8 m; make it lower"),
    "opening as large as the wall": ('thickness = "150 mm"\n\n[[walls]]',
        'thickness = "150 mm"\nopenings = [{ left = "0 m", width = "4 m", bottom = "0 m", '
        'height = "2.8 m", stories = "high" }]\n\n[[walls]]',
        r"walls\[0\]\.openings: the openings leave nothing of the wall in story high"),
    "opening of a story without the wall": ('role = "non_structural"',
        'stories = "low"\nopenings = [{ left = "1 m", width = "1 m", bottom = "0 m", '
        'height = "2 m", stories = "high" }]',
        r"walls\[1\]\.openings\[0\]\.stories: no story of this wall is named 'high'"),
    "column outside the grid": ('[[columns]]\nsection = "column"',
        '[[columns]]\nsection = "column"\npoints = [["8 m", "1 m"]]',
        r"columns\[0\]\.points\[0\]: x = 8 m lies outside the grid \(0 to 7 m\)"),
    "column placed twice": ('[[columns]]\nsection = "column"',
        '[[columns]]\nsection = "column"\nat = "A-P"\npoints = [["3 m", "1 m"]]',
        r"columns\[0\]\.points: give either intersections \(at\) or coordinates"),
    "rigid ends longer than a span": ('[[beams]]\nsection = "beam"',
        '[[beams]]\nsection = "beam"\nrigid_ends = ["2 m", "1 m"]',
        r"beams\[0\]\.rigid_ends: they leave nothing of the span B to C on P, 3 m"),
    "springs without stiffness": ("[mesh]", '[supports]\nbase = "springs"\n\n[mesh]',
        r"supports\.kx: springs need a stiffness; write one of kx, ky"),
    "stiffness without springs": ("[mesh]", '[supports]\nkry = "5 MN m/rad"\n\n[mesh]',
        r'supports\.kry: it needs base = "springs", not \'fixed\''),
    "flange thicker than the beam": ('[sections.beam]\nshape = "rectangle"',
        '[sections.beam]\nshape = "T"\nflange_width = "1 m"\nflange_thickness = "0.5 m"',
        r"sections\.beam\.flange_thickness: 0.5 m must be less than the depth, 0.4 m"),
    "unknown grid line": ('along = "P"', 'along = "R"',
        r"walls\[0\]\.along: no grid line is named 'R' \(known: A, B, C, P, Q\)"),
    "wall to a parallel line": ('to = "B"', 'to = "Q"',
        r"walls\[0\]\.to: 'Q' does not cross 'P'; write one of A, B, C"),
    "slab of no width": ('x = ["A", "C"]', 'x = ["A", "A"]', r"slabs\[0\]\.x: it starts and ends"),
    "unknown story": ('role = "non_structural"', 'stories = ["hihg"]',
        r"walls\[1\]\.stories: no story is named 'hihg'.*did you mean 'high'"),
    "floor mass twice": ('total = "60 t"', 'total = "60 t"\n[[floor_mass]]\ntotal = "50 t"',
        r"floor_mass\[1\]\.floors: floor_mass\[0\] gives the mass of 2F already"),
    "floor mass below self weight": ('"60 t"', '"20 t"', r"floor_mass\[0\]\.total: 2F weighs "
        r"[\d.]+ t by itself .*more than the 20 t"),
    "floor mass without a slab": ('thickness = "150 mm"\n\n[[floor',
        'thickness = "150 mm"\nfloors = "2F"\n\n[[floor', r"floor_mass\[0\]\.floors: RF has no"),
    "empty list": ('total = "60 t"', 'total = "60 t"\nfloors = []',
        r"floor_mass\[0\]\.floors: the"),
    "all beside a name": ('total = "60 t"', 'total = "60 t"\nfloors = ["2F", "*"]',
        r'floor_mass\[0\]\.floors: "\*" stands for all'),
    "story named twice": ('name = "high"', 'name = "low"',
        r"stories\[1\]\.name: 'low' is the name of stories\[0\]"),
    "lines on each other": ('B = "4 m"', 'B = "0.0001 m"', r"grid\.x\.B: it lies on 'A'"),
    "same name across": ('Q = "5 m"', 'B = "5 m"', r"grid\.x\.B: a line of grid\.y has the same"),
    "hyphen in a line": ('C = "7 m"', 'C = "7 m"\nD-1 = "9 m"', r"grid\.x\.D-1: a line's name"),
    "no such section": ('section = "beam"', 'section = "bean"',
        r"beams\[0\]\.section: no section is named 'bean'.*did you mean 'beam'"),
    "which material": ("[sections.column]", '[materials.steel]\nyoungs_modulus = "205 GPa"\n'
        'poisson_ratio = 0.3\ndensity = "7850 kg/m3"\n\n[sections.column]',
        r"sections\.column\.material: .*name one of the materials concrete, steel"),
    "unstable Poisson": ("poisson_ratio = 0.2", "poisson_ratio = 0.5",
        r"materials\.concrete\.poisson_ratio: 0.5 must lie from 0 to below 0.5"),
    "prior upside down": ('lower = "1/3"', "lower = 4",
        r"prior\.theta\.lower: 4 must lie below upper = 3; exchange the two"),
    "prior divided by zero": ('"1/3"', '"1/0"', r"prior\.theta\.lower: '1/0' is not a number"),
    "prior of no story": ("[prior.zeta]", "[prior.stories.top]\nlower = 1\nupper = 2\n[prior.zeta]",
        r"prior\.stories\.top: no story is named 'top' \(known: low, high\)"),
    "nuisance with Rayleigh": ('law = "constant"', 'law = "rayleigh"\nanchors = ["1 Hz", "9 Hz"]',
        r"prior\.zeta: Rayleigh damping is fixed by its anchors"),
    "modes of no frequency": ('law = "constant"\nratio = 0.02',
        'law = "modes"\nratio = 0.02\nratios = [0.02, 0.03]',
        r"damping\.anchors: the key is missing; add the frequency of each mode"),
    "more ratios than modes": ('law = "constant"\nratio = 0.02',
        'law = "modes"\nratio = 0.02\nratios = [0.02, 0.03]\nanchors = ["1 Hz"]',
        r"damping\.ratios: write a ratio for each of the 1 anchors"),
    "modes out of order": ('law = "constant"\nratio = 0.02',
        'law = "modes"\nratio = 0.02\nratios = [0.02, 0.03]\nanchors = ["2 Hz", "1 Hz"]',
        r"damping\.anchors: frequencies of modes must rise"),
    "ratio of a mode above critical": ('law = "constant"\nratio = 0.02',
        'law = "modes"\nratio = 0.02\nratios = [0.02, 3]\nanchors = ["1 Hz", "2 Hz"]',
        r"damping\.ratios: 3 must lie below 1"),
    "two ratios of the first mode": ('law = "constant"\nratio = 0.02',
        'law = "modes"\nratio = 0.02\nratios = [0.03, 0.02]\nanchors = ["1 Hz", "2 Hz"]',
        r"damping\.ratios: the first, 0\.03, must be `ratio`, 0\.02"),
    "one anchor twice": (ZETA + '\n[damping]\nlaw = "constant"',
        '[damping]\nlaw = "rayleigh"\nanchors = ["5 Hz", "5 Hz"]',
        r"damping\.anchors: the two frequencies must"),
    "sensor off the grid": ('"Q-B"]', '"Q-Z"]', r"sensors\.points\[1\]: no grid line is named 'Z'"),
    "sensor on parallel lines": ('"Q-B"]', '"A-B"]', r"sensors\.points\[1\]: 'A' and 'B' are par"),
    "sensor outside of the building": ("[frequency_grid]",
        '[sensors.at]\n2F = [["40 m", "0 m", "3.2 m"]]\n[frequency_grid]',
        r"sensors\.at\.2F\[0\]: \(40, 0, 3.2\) m lies outside of the building, whose nearest node"),
    "sensor at a point in plan": ("[frequency_grid]",
        '[sensors.at]\n2F = [["4 m", "0 m"]]\n[frequency_grid]', r"sensors\.at\.2F\[0\]"),
    "two walls in one place": (
        'along = "C"\nfrom = "P"\nto = "Q"\nthickness = "100 mm"\nrole = "non_structural"',
        'along = "P"\nfrom = "A"\nto = "C"\nthickness = "100 mm"',
        r"walls\[1\]: it lies on walls\[0\] at",
    ),
    "two columns in one place": ("[[beams]]",
        '[[columns]]\nsection = "column"\nat = "A-P"\n[[beams]]',
        r"columns\[1\]: it lies on columns\[0\] at"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_wrong_file(case, tmp_path):
    old, new, message = CASES[case]
    assert old in SMALL
    path = tmp_path / "wrong.toml"
    path.write_text(SMALL.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(BuildingError) as error:
        load_building(path)
    sentence = str(error.value)
    assert re.search(r"wrong\.toml: " + message, sentence), sentence
    assert "\n" not in sentence
    assert "pydantic" not in sentence
    assert "type=" not in sentence


def write(tmp_path, text):
    path = tmp_path / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_text_where_a_table_belongs(tmp_path):
    text = SMALL.replace('[mesh]\nsize = "1 m"\n', "").replace("kind", 'mesh = "1 m"\nkind', 1)
    with pytest.raises(BuildingError, match="mesh: must be a table"):
        load_building(write(tmp_path, text))


def test_story_without_column_or_stiff_wall(tmp_path):
    text = SMALL.replace('section = "column"\n', 'section = "column"\nstories = "low"\n', 1)
    text = text.replace('thickness = "150 mm"\n', 'thickness = "150 mm"\nstories = "low"\n', 1)
    with pytest.raises(BuildingError, match=r"stories\[1\]: no column or wall with stiffness"):
        load_building(write(tmp_path, text))


def test_floating_part_is_located(tmp_path):
    text = SMALL.replace("[[slabs]]", '[[slabs]]\nfloors = "2F"')
    text = text.replace('section = "beam"', 'section = "beam"\nfloors = ["2F", "RF"]')
    text = text.replace('section = "column"\n', 'section = "column"\nat = ["A-P", "B-P"]\n', 1)
    # Line Q of the roof is then held by beams of the roof alone, which do reach P: it stands.
    text = text.replace("[[floor_mass]]", '[[floor_mass]]\nfloors="2F"')
    load_building(write(tmp_path, text))
    alone = text.replace('floors = ["2F", "RF"]', 'along = ["P", "Q"]\nfloors = ["2F", "RF"]')
    alone = alone.replace('role = "non_structural"', 'role = "non_structural"\nstories = "low"')
    alone = alone.replace('along = "C"', 'along = "P"')
    alone = alone.replace('from = "P"\nto = "Q"', 'from="A"\nto="B"')
    alone = alone.replace('points = ["P-B", "Q-B"]', 'points = ["P-B"]')
    with pytest.raises(BuildingError, match=r"nothing connects what is at \(0, 5, 6\) m to"):
        load_building(write(tmp_path, alone))


def test_sensor_where_nothing_is_built(tmp_path):
    text = SMALL.replace('x = ["A", "C"]', 'x = ["A", "B"]')
    text = text.replace('section = "beam"\n', 'section = "beam"\nalong = ["A", "B"]\n', 1)
    text = text.replace('section = "column"\n', 'section = "column"\nat = ["A-P", "B-P"]\n', 1)
    text = text.replace('along = "C"', 'along = "A"').replace('"Q-B"]', '"Q-C"]')
    with pytest.raises(BuildingError, match=r"sensors\.points: nothing is built at Q-C on 2F;"):
        load_building(write(tmp_path, text))


def test_wall_without_stiffness_that_nothing_carries(tmp_path):
    text = SMALL.replace('x = ["A", "C"]', 'x = ["A", "B"]')
    text = text.replace('section = "beam"\n', 'section = "beam"\nalong = ["P", "Q"]\n', 1)
    with pytest.raises(BuildingError, match=r"walls\[1\]: nothing at .* above the wall,"):
        load_building(write(tmp_path, text))


@pytest.mark.parametrize("stiffness", [{"stiffness": 5e3, "stiffness_per_mass": 3.0}, {}])
def test_shear_story_with_two_stiffnesses_or_none(stiffness):
    story = {"name": "S1", "mass": 2e3} | stiffness
    with pytest.raises(BuildingError, match=r"stories\[0\]\.stiffness: give either"):
        from_document(stick([2e3], [5e3], stories=[story]))


@pytest.mark.parametrize(
    ("text", "program"),
    [
        ('$ File C:\\a.e2k saved 1/1/2024\n  PROGRAM  "ETABS"  VERSION "20"\n', "ETABS"),
        ("# comment\nmodel BasicBuilder -ndm 3 -ndf 6\nnode 1 0 0 0\n", "OpenSees"),
        ("wipe\nmodel basic -ndm 2\n", "OpenSees"),
    ],
)
def test_models_of_other_programs_are_recognised(tmp_path, text, program):
    with pytest.raises(BuildingError, match=f"a model of {program}; (give its|let it print)"):
        load_building(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = " + "[" * 100_000, "nested too deeply"),
        ("a = " + "{b = " * 100_000, "nested too deeply|not valid TOML"),
        ("a." * 100_000 + "b = 1", "nested too deeply"),
        ("a = {b" + ".c" * 100_000 + " = 1}", "nested too deeply"),
        ("[" + "a." * 100_000 + "b]", "nested too deeply"),
        ("count = " + "9" * 5000, r"a value cannot be read \(Exceeds the limit"),
    ],
    ids=["lists", "tables", "dotted key", "inline dotted key", "dotted table", "long integer"],
)
def test_files_made_to_harm_are_refused_at_once(tmp_path, text, message):
    started = time.monotonic()
    with pytest.raises(BuildingError, match=message):
        load_building(write(tmp_path, f"{SMALL}\n{text}\n"))
    assert time.monotonic() - started < 5.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('total = "60 t"', 'total = "1e300 t"', r"floor_mass\[0\]\.total: .*mass that no building"),
        ('"3.2 m"', '"3.5 mm"', r"stories\[0\]\.height: a story 3.5 mm high is none; is the unit"),
        ('"3.2 m"', '"3200 km"', r"stories\[0\]\.height: .* is a length that no building has"),
        ('"25 GPa"', '"1e-9 GPa"', r"youngs_modulus: .* is a stress that no building has"),
        ('width = "300 mm"', 'width = "1e-300 mm"', r"sections\.column\.width: .* no building has"),
        ('"2400 kg/m3"', '"1e9 t/m3"', r"density: .* is a density that no building has"),
        ('step = "0.1 Hz"', 'step = "1e30 Hz"', r"frequency_grid\.step: .* that no building has"),
    ],
)
def test_figures_that_no_building_has(tmp_path, old, new, message):
    assert old in SMALL
    with pytest.raises(BuildingError, match=message):
        load_building(write(tmp_path, SMALL.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '"25 GPa"',
            '"8 GPa"',
            "concrete: youngs_modulus is 8 GPa, and 10 to 60 GPa are",
        ),
        (
            'materials.concrete]\nyoungs_modulus = "25 GPa"',
            'materials.c]\nyoungs_modulus = "210 MPa"',
            "materials.c: youngs_modulus is 0.21 GPa, and steel has 210",
        ),
        (
            '"2400 kg/m3"',
            '"0 kg/m3"',
            "materials.concrete: density is zero: the members made",
        ),
        ('"2400 kg/m3"', '"2.4 kg/m3"', "density is 2.4 kg/m3, and steel has 7850, concrete"),
        (FIXED, "", "supports: the table is left out, so the base is fixed"),
        (
            'width = "300 mm"\ndepth = "500 mm"',
            'width = "30 mm"\ndepth = "300 cm"',
            "sections.column: a column 3 m wide stands in story high, which is 2.8 m high",
        ),
        (
            'thickness = "150 mm"\n\n[[floor',
            'thickness = "40 mm"\n\n[[floor',
            "slabs[0]: bays of 4 by 5 m bend from about 1.4 Hz, far below the top",
        ),
    ],
)
def test_figures_that_an_engineer_would_ask_about(tmp_path, caplog, old, new, message):
    for _ in range(2):  # told once, however often a command reads the file
        load_building(write(tmp_path, (SMALL + FIXED).replace(old, new, 1)))
    assert caplog.text.count(message) == 1


@pytest.mark.parametrize(("mass", "asked"), [(20.0, False), (0.02, True), (200e3, True)])
def test_frequencies_that_no_stick_so_high_has_are_asked_about(tmp_path, caplog, mass, asked):
    """Three stories of 3 m and 30 kN/mm: 2.7 Hz with 20 t, 87 and 0.03 Hz in other units."""
    story = f'height = "3 m"\nmass = "{mass} t"\nstiffness = "30 kN/mm"\n'
    stories = "".join(f'[[stories]]\nname = "S{k}"\n{story}' for k in (1, 2, 3))
    text = 'name = "stick"\nkind = "shear"\n'
    text += 'frequency_grid = { start = "1 Hz", step = "1 Hz", count = 9 }\n'
    text += f'damping = {{ law = "constant", ratio = 0.02 }}\n{stories}'
    load_building(write(tmp_path, text))
    assert ("the lowest frequency is" in caplog.text) == asked


@pytest.mark.parametrize(
    ("names", "asked"),
    [
        (("S3", "S2", "S1"), True),
        (("S1", "S2", "S3"), False),
        (("B2", "B1", "S1"), False),
        (("top", "low", "ground"), False),
    ],
)
def test_story_names_that_count_downwards_are_asked_about(tmp_path, caplog, names, asked):
    text = building_text("shear_3dof")[1]
    for old, new in zip(("S1", "S2", "S3"), names, strict=True):
        text = text.replace(f'name = "{old}"', f'name = "{new}!"')
    load_building(write(tmp_path, text.replace("!", "")))
    assert ("their names count downwards" in caplog.text) == asked


def test_usual_figures_are_taken_in_silence(tmp_path, caplog):
    load_building(write(tmp_path, SMALL + FIXED))
    assert caplog.records == []
