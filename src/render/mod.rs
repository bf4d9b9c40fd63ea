//! Pictures of yarns: one scene, one camera, one shading model, whatever draws it.
