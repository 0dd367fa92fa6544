"""The building as data: files, validation, mesh, and the matrices of shear buildings."""

from femupdate.lazy import lazily

_PUBLIC = {
    "building_hash": "document",
    "building_text": "shipped",
    "EffectEntry": "common",
    "factor_titles": "parameters",
    "FrameBuilding": "frame",
    "from_document": "document",
    "import_mesh": "mesh_import",
    "load_building": "files",
    "mechanics_hash": "document",
    "mesh_building": "mesh",
    "save_building": "files",
    "Section": "sections",
    "self_mass": "building_mesh",
    "shear_operators": "shear",
    "shipped_buildings": "shipped",
    "stiffness_factors": "parameters",
    "to_document": "document",
}
__all__ = list(_PUBLIC)
__getattr__ = lazily(__name__, _PUBLIC)
