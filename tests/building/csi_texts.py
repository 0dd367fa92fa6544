# ruff: noqa: E501 - lines as other programs write them
"""One building of two stories as text of SAP2000 and of ETABS, in kN and m."""

PLAN = ((0, 0), (5, 0), (5, 4), (0, 4))
LEVELS = (0.0, 3.5, 6.5)


def sap2000() -> str:
    """Four columns, beams with modifiers, pins and end offsets, membrane slabs and a wall."""
    joints, frames, assigned, held, areas, area_sections, constraints = ([] for _ in range(7))
    for k, z in enumerate(LEVELS):
        for n, (x, y) in enumerate(PLAN, 1):
            joints.append(
                f"Joint={10 * k + n}   CoordSys=GLOBAL   CoordType=Cartesian   XorR={x}   Y={y}   Z={z}"
            )
    joints.append("Joint=99   CoordSys=GLOBAL   CoordType=Cartesian   XorR=2.5   Y=0   Z=6.5")
    number = 0

    def frame(a, b, section):
        nonlocal number
        number += 1
        frames.append(f"Frame={number}   JointI={a}   JointJ={b}   IsCurved=No")
        assigned.append(
            f'Frame={number}   AutoSelect=N.A.   AnalSect="{section}"   MatProp=Default'
        )

    for k in (0, 1):
        for n in range(1, 5):
            frame(10 * k + n, 10 * k + 10 + n, "COL")
        for n in range(1, 5):
            frame(10 * k + 10 + n, 10 * k + 10 + n % 4 + 1, "BEAM 1")
    frame(99, 23, "BEAM 1")
    for k in (1, 2):
        areas.append(
            f"Area={k}   NumJoints=4   Joint1={10 * k + 1}   Joint2={10 * k + 2}   Joint3={10 * k + 3}   Joint4={10 * k + 4}"
        )
        area_sections.append(f"Area={k}   Section=SLAB   MatProp=Default")
        areas.append(
            f"Area={k + 2}   NumJoints=4   Joint1={10 * k - 10 + 4}   Joint2={10 * k - 10 + 3}   Joint3={10 * k + 3}   Joint4={10 * k + 4}"
        )
        area_sections.append(f"Area={k + 2}   Section=WALL   MatProp=Default")
        constraints += [
            f"Joint={10 * k + n}   Constraint=D{k}   Type=Diaphragm" for n in range(1, 5)
        ]
    constraints.append("Joint=99   Constraint=D2   Type=Diaphragm")
    held = [f"Joint={n}   U1=Yes   U2=Yes   U3=Yes   R1=Yes   R2=Yes   R3=Yes" for n in range(1, 5)]
    tables = {
        "PROGRAM CONTROL": [
            'ProgramName=SAP2000   Version=23.1.0   CurrUnits="KN, m, C" _\n        SteelCode="AISC 360-16"'
        ],
        "MATERIAL PROPERTIES 02 - BASIC MECHANICAL PROPERTIES": [
            "Material=C30   UnitWeight=24.516625   UnitMass=2.5   E1=30000000   G12=12500000   U12=0.2"
        ],
        "FRAME SECTION PROPERTIES 01 - GENERAL": [
            "SectionName=COL   Material=C30   Shape=Rectangular   t3=0.5   t2=0.4   Area=0.2   TorsConst=0.00549544136 _\n        I33=0.00416666667   I22=0.00266666667   AS2=0.166666667   AS3=0.166666667   I2Mod=0.7   I3Mod=0.7",
            'SectionName="BEAM 1"   Material=C30   Shape=Rectangular   t3=0.6   t2=0.3',
        ],
        "AREA SECTION PROPERTIES": [
            "Section=SLAB   Material=C30   AreaType=Shell   Type=Membrane   Thickness=0.15",
            "Section=WALL   Material=C30   AreaType=Shell   Type=Shell-Thin   Thickness=0.2   F11Mod=.5   F22Mod=.5   F12Mod=.5   M11Mod=.25   M22Mod=.25   M12Mod=.25",
        ],
        "JOINT COORDINATES": joints,
        "CONNECTIVITY - FRAME": frames,
        "FRAME SECTION ASSIGNMENTS": assigned,
        "FRAME RELEASE ASSIGNMENTS 1 - GENERAL": [
            f"Frame={number}   PI=No   V2I=No   V3I=No   TI=No   M2I=Yes   M3I=Yes   PJ=No   V2J=No   V3J=No   TJ=No   M2J=Yes   M3J=Yes"
        ],
        "FRAME OFFSET ALONG LENGTH ASSIGNMENTS": [
            "Frame=6   Type=User   LengthI=0.25   LengthJ=0.25   RigidFactor=0.5"
        ],
        "FRAME LOCAL AXES ASSIGNMENTS 1 - TYPICAL": ["Frame=2   Angle=90   AdvanceAxes=No"],
        "FRAME PROPERTY MODIFIERS": [
            "Frame=7   AMod=1   AS2Mod=1   AS3Mod=1   JMod=0.1   I22Mod=0.35   I33Mod=0.35"
        ],
        "CONNECTIVITY - AREA": areas,
        "AREA SECTION ASSIGNMENTS": area_sections,
        "JOINT RESTRAINT ASSIGNMENTS": held,
        "CONSTRAINT DEFINITIONS - DIAPHRAGM": [
            "Name=D1   CoordSys=GLOBAL   Axis=Z   MultiLevel=No",
            "Name=D2   CoordSys=GLOBAL   Axis=Z   MultiLevel=No",
        ],
        "JOINT CONSTRAINT ASSIGNMENTS": constraints,
        "LOAD PATTERN DEFINITIONS": [
            "LoadPat=DEAD   DesignType=Dead   SelfWtMult=1",
            "LoadPat=LIVE   DesignType=Live   SelfWtMult=0",
        ],
        "AREA LOADS - UNIFORM": [
            "Area=1   LoadPat=LIVE   CoordSys=GLOBAL   Dir=Gravity   UnifLoad=2"
        ],
        "FRAME LOADS - DISTRIBUTED": [
            "Frame=5   LoadPat=DEAD   CoordSys=GLOBAL   Type=Force   Dir=Gravity   DistType=RelDist   RelDistA=0   RelDistB=1   FOverLA=10   FOverLB=10"
        ],
        "JOINT ADDED MASS ASSIGNMENTS": [
            "Joint=13   CoordSys=GLOBAL   Mass1=3   Mass2=3   Mass3=3   MMI1=0   MMI2=0   MMI3=0"
        ],
        "MASS SOURCE": [
            "MassSource=MSSSRC1   Elements=No   Masses=Yes   Loads=Yes   IsDefault=Yes   LoadPat=DEAD   Multiplier=1",
            "MassSource=MSSSRC1   LoadPat=LIVE   Multiplier=0.25",
        ],
        "GRID LINES": ["CoordSys=GLOBAL   AxisDir=X   GridID=A   XRYZCoord=0"],
    }
    body = "\n\n".join(
        f'TABLE:  "{name}"\n' + "\n".join(f"   {row}" for row in rows)
        for name, rows in tables.items()
    )
    return f"File C:\\x.s2k was saved on 1/1/20\n\n{body}\n\nEND TABLE DATA\n"


# The mass of it, kg: columns, beams, slabs, walls, a line load, live load and an added mass.
BEAMS = 0.18 * (2 * 18.0 + (2.5**2 + 4.0**2) ** 0.5)
KG = 2500.0 * (0.2 * 4 * 6.5 + BEAMS + 0.15 * 40.0 + 0.2 * 5.0 * 6.5)
KG += (10.0 * 5.0 + 0.25 * 2.0 * 20.0) * 1e3 / 9.80665 + 3000.0


def etabs() -> str:
    """The same building without the added mass."""
    points = "\n".join(f'  POINT "{n}"  {x} {y}' for n, (x, y) in enumerate(PLAN, 1))
    lines = [f'  LINE "C{n}" COLUMN "{n}" "{n}" 1' for n in range(1, 5)]
    lines += [f'  LINE "B{n}" BEAM "{n}" "{n % 4 + 1}" 0' for n in range(1, 5)]
    lines.append('  LINE "B5" BEAM "5" "3" 0')
    assigns = []
    for story in ("Story1", "Story2"):
        top = story == "Story2"
        for n in range(1, 5):
            turned = " ANG 90" if n == 2 and not top else ""
            assigns.append(f'  LINEASSIGN "C{n}" "{story}" SECTION "COL"{turned} AUTOMESH "YES"')
        for n in range(1, 5):
            more = " LENGTHOFFI .25 LENGTHOFFJ .25 RIGIDZONE 0.5" if n == 2 and not top else ""
            more += " PROPMODT .1 PROPMODI22 .35 PROPMODI33 .35" if n == 3 and not top else ""
            assigns.append(f'  LINEASSIGN "B{n}" "{story}" SECTION "BEAM 1"{more} MINNUMSTA 3')
    assigns.append('  LINEASSIGN "B5" "Story2" SECTION "BEAM 1" RELEASE "M2I M3I M2J M3J"')
    slabs = "\n".join(
        f'  AREAASSIGN "F1" "{s}" SECTION "SLAB" DIAPH "D1"' for s in ("Story1", "Story2")
    )
    walls = "\n".join(
        f'  AREAASSIGN "W1" "{s}" SECTION "WALL" PIER "P1"' for s in ("Story1", "Story2")
    )
    held = "\n".join(
        f'  POINTASSIGN "{n}" "Base" RESTRAINT "UX UY UZ RX RY RZ" DIAPH "DISCONNECTED"'
        for n in range(1, 5)
    )
    joined = "\n".join(lines)
    given = "\n".join(assigns)
    return f"""$ File C:\\x.e2k saved 1/1/2020
$ PROGRAM INFORMATION
  PROGRAM  "ETABS"  VERSION "20.0.0"
$ CONTROLS
  UNITS  "KN"  "M"  "C"
$ STORIES - IN SEQUENCE FROM TOP
  STORY "Story2"  HEIGHT 3 MASTERSTORY "Yes"
  STORY "Story1"  HEIGHT 3.5
  STORY "Base"  ELEV 0
$ DIAPHRAGM NAMES
  DIAPHRAGM "D1"    TYPE RIGID
$ MATERIAL PROPERTIES
  MATERIAL  "C30"    TYPE "Concrete"    WEIGHTPERVOLUME 24.516625
  MATERIAL  "C30"    SYMTYPE "Isotropic"  E 3E+07  U 0.2  A 1E-05
$ FRAME SECTIONS
  FRAMESECTION  "COL"  MATERIAL "C30"  SHAPE "Concrete Rectangular"  D 0.5  B 0.4
  FRAMESECTION  "COL"  I22MODIFIER 0.7  I33MODIFIER 0.7
  FRAMESECTION  "BEAM 1"  MATERIAL "C30"  SHAPE "Concrete Rectangular"  D 0.6  B 0.3
$ SLAB PROPERTIES
  SHELLPROP  "SLAB"  PROPTYPE  "Slab"  MATERIAL "C30"  MODELINGTYPE "Membrane"  SLABTYPE "Slab"  SLABTHICKNESS 0.15
$ WALL PROPERTIES
  SHELLPROP  "WALL"  PROPTYPE  "Wall"  MATERIAL "C30"  MODELINGTYPE "ShellThin"  WALLTHICKNESS 0.2 F11MOD .5 F22MOD .5 F12MOD .5
  SHELLPROP  "WALL"  M11MOD .25 M22MOD .25 M12MOD .25
$ POINT COORDINATES
{points}
  POINT "5"  2.5 0
$ LINE CONNECTIVITIES
{joined}
$ AREA CONNECTIVITIES
  AREA "F1"  FLOOR  4  "1"  "2"  "3"  "4"  0  0  0  0
  AREA "W1"  PANEL  4  "4"  "3"  "3"  "4"  1  1  0  0
$ POINT ASSIGNS
{held}
$ LINE ASSIGNS
{given}
$ AREA ASSIGNS
{slabs}
{walls}
$ LOAD PATTERNS
  LOADPATTERN "Dead"  TYPE  "Dead"  SELFWEIGHT  1
  LOADPATTERN "Live"  TYPE  "Live"  SELFWEIGHT  0
$ FRAME OBJECT LOADS
  LINELOAD  "B1"  "Story1"  TYPE "UNIFF"  DIR "GRAVITY"  LC "Dead"  FVAL 10
$ SHELL OBJECT LOADS
  AREALOAD  "F1"  "Story1"  TYPE "UNIFF"  DIR "GRAV"  LC "Live"  FVAL 2
$ MASS SOURCE
  MASSSOURCE  "MsSrc1"    INCLUDEELEMENTS "No"    INCLUDEADDEDMASS "No"    INCLUDELOADS "Yes"    LUMPATSTORIES "Yes"    ISDEFAULT "Yes"
  MASSSOURCELOAD  "MsSrc1"  "Dead"  1
  MASSSOURCELOAD  "MsSrc1"  "Live"  0.25
$ GRIDS
  GRIDSYSTEM "G1"  TYPE "CARTESIAN"  BUBBLESIZE 1.25
$ END OF MODEL FILE
"""
