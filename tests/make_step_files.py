#!/usr/bin/env python3
"""Writes the STEP files of tests/fixtures/step: pip install cadquery; python tests/make_step_files.py

Shapes whose volume and area have formulas (tests/step.rs), and three that `monstertruck` 0.4.1 cannot cut into triangles.
"""

import pathlib

import cadquery as cq
from cadquery import exporters
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

FOLDER = pathlib.Path(__file__).parent / "fixtures" / "step"
block = cq.Workplane().box(40, 30, 20, centered=False)
cylinder = cq.Workplane().circle(15).extrude(40)
pocket = (cq.Workplane().box(60, 40, 20, centered=False).faces(">Z").workplane(centerOption="CenterOfBoundBox").rect(40, 20).cutBlind(-12)
          .edges("|Z and (not(<X or >X or <Y or >Y))").fillet(4))
parts = {
    "block": block,
    "cylinder": cylinder,
    "pocket": pocket,
    "bores": (cq.Workplane().box(60, 40, 20, centered=False).faces(">Z").workplane(centerOption="CenterOfBoundBox").rarray(20, 20, 2, 2).hole(8)
              .faces(">Z").workplane(centerOption="CenterOfBoundBox").cboreHole(6, 12, 5)),
    "cone": cq.Workplane(cq.Solid.makeCone(15, 5, 30)),
    "conetip": cq.Workplane(cq.Solid.makeCone(15, 0, 30)),
    "sphere": cq.Workplane().sphere(12),
    "torus": cq.Workplane(cq.Solid.makeTorus(20, 6)),
    "spline": (cq.Workplane("XZ").spline([(0, 0), (10, 6), (20, 2), (30, 9)]).lineTo(30, -10).lineTo(0, -10).close()
               .extrude(25)),
    "sweep": cq.Workplane("XZ").circle(4).sweep(cq.Workplane("XY").spline([(0, 0), (0, 20), (15, 40), (30, 40)])),
    "void": cq.Workplane().box(40, 40, 40).cut(cq.Workplane().sphere(10)),
}
FOLDER.mkdir(parents=True, exist_ok=True)
for name, part in parts.items():
    exporters.export(part, str(FOLDER / f"{name}.step"))
    print(name, part.val().Volume(), part.val().Area())
assembly = cq.Assembly()
assembly.add(block, name="a")
assembly.add(cylinder, name="b", loc=cq.Location(cq.Vector(20, 15, 20)))
assembly.add(cylinder, name="c", loc=cq.Location(cq.Vector(100, 0, 0), cq.Vector(0, 1, 0), 90))
assembly.export(str(FOLDER / "assembly.step"))
for unit, name in (("INCH", "inch"), ("CM", "cm"), ("M", "m")):
    STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    writer = STEPControl_Writer()
    writer.Transfer(pocket.val().wrapped, STEPControl_AsIs)
    writer.Write(str(FOLDER / f"{name}.step"))
