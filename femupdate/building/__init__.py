"""The building as data: files, validation, mesh, and the matrices of shear buildings."""

from femupdate.lazy import public

__all__, __getattr__ = public(
    __name__,
    {
        "building_mesh": "self_mass",
        "common": "EffectEntry",
        "document": "factor_titles from_document mechanics_hash to_document",
        "files": "load_building save_building",
        "kinds": "FrameBuilding shear_operators",
        "mesh": "mesh_building",
        "mesh_import": "import_mesh",
        "sections": "Section",
        "shipped": "building_text shipped_buildings",
    },
)
