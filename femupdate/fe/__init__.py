"""Elements, assembly, static and modal solution, export."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "assembly": "assemble",
        "driven": "driven_shapes",
        "elements.beam": "Beams",
        "elements.shell": "Shells",
        "elements.triangle": "Triangles",
        "export": "bulk_data opensees_script",
        "factorization": "factorize",
        "joints": "edge_joints joint_links",
        "model": "Elements FiniteElementModel PointMasses RigidLinks Springs",
        "registry": "cell_types element_for element_kinds",
        "solve": "lowest_modes modes_below static_displacement",
    },
)
