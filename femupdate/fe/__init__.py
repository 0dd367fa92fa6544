"""Elements, assembly, static and modal solution, export."""

from femupdate.lazy import lazily

_PUBLIC = {
    "assemble": "assembly",
    "Beams": "elements.beam",
    "cell_types": "registry",
    "driven_shapes": "driven",
    "edge_joints": "joints",
    "element_for": "registry",
    "element_kinds": "registry",
    "Elements": "element",
    "factorize": "factorization",
    "FiniteElementModel": "model",
    "joint_links": "joints",
    "lowest_modes": "solve",
    "modes_below": "solve",
    "opensees_script": "export_opensees",
    "PointMasses": "model",
    "RigidLinks": "model",
    "Shells": "elements.shell",
    "Springs": "model",
    "static_displacement": "solve",
    "Triangles": "elements.triangle",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)
