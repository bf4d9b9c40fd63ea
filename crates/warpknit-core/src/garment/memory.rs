//! Garments from memory: arrays, and OBJ text from any reader.
//!
//! In: arrays in millimetres, or [`BufRead`]ers. Out: a [`Garment`], by the same steps as from
//! files. Cost: as from files, without the disk.

use std::io::BufRead;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::error::ArrayFault;
use super::obj::{self, Face, Label, ObjMesh};
use super::{Garment, GarmentError, GarmentFiles, ReadOptions, Unit};

/// The name of OBJ text in messages, where it is the only one or the flat one.
const FLAT: &str = "FLAT.obj";
/// The name of the draped OBJ text in messages.
const DRAPED: &str = "DRAPED.obj";
/// The name of arrays in messages.
const ARRAYS: &str = "arrays";

impl Garment {
    /// A garment from arrays: vertex `i` lies at `flat[i]` on the pattern and at `draped[i]` on the
    /// body, mm. `triangles` holds indices of vertices. Triangles that share no vertex belong to
    /// different panels.
    ///
    /// # Errors
    /// [`GarmentError::Arrays`] where lengths differ, an index is out of range or a number is not
    /// finite; otherwise as of [`super::read`].
    ///
    /// ```
    /// use glam::{DVec2, DVec3};
    /// use warpknit_core::garment::Garment;
    /// // A square of 100 mm, bent along its diagonal.
    /// let flat = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)].map(DVec2::from);
    /// let draped = [0.0, 0.0, 30.0, 0.0].map(f64::from);
    /// let draped: Vec<DVec3> = flat.iter().zip(draped).map(|(p, z)| p.extend(z)).collect();
    /// let garment = Garment::from_arrays(&flat, &draped, &[[0, 1, 2], [0, 2, 3]])?;
    /// assert_eq!(garment.panels.len(), 1);
    /// assert!((garment.panels[0].area() - 10_000.0).abs() < 1e-6);
    /// # Ok::<(), warpknit_core::garment::GarmentError>(())
    /// ```
    pub fn from_arrays(
        flat: &[DVec2],
        draped: &[DVec3],
        triangles: &[[u32; 3]],
    ) -> Result<Self, GarmentError> {
        // The arrays are in mm on both sides, so nothing is to be estimated. The summary tells of a
        // loss, which the caller may judge.
        let options = ReadOptions {
            unit: Some(Unit::Mm),
            uv_scale: Some(1.0),
            allow_loss: true,
            ..ReadOptions::default()
        };
        Self::from_arrays_with(flat, draped, triangles, &options)
    }

    /// The same with options: `draped` in any unit, and `flat` at a scale that is estimated where
    /// none is given, such as that of a UV map.
    ///
    /// # Errors
    /// As of [`Self::from_arrays`].
    ///
    /// ```
    /// use glam::{DVec2, DVec3};
    /// use warpknit_core::garment::{Garment, ReadOptions, Unit};
    /// let uv = [DVec2::ZERO, DVec2::X, DVec2::Y];
    /// let draped = [DVec3::ZERO, 0.3 * DVec3::X, 0.3 * DVec3::Z];
    /// let metres = ReadOptions { unit: Some(Unit::M), ..ReadOptions::default() };
    /// let garment = Garment::from_arrays_with(&uv, &draped, &[[0, 1, 2]], &metres)?;
    /// assert!((garment.summary.uv_scale_mm - 300.0).abs() < 1e-9);
    /// # Ok::<(), warpknit_core::garment::GarmentError>(())
    /// ```
    pub fn from_arrays_with(
        flat: &[DVec2],
        draped: &[DVec3],
        triangles: &[[u32; 3]],
        options: &ReadOptions,
    ) -> Result<Self, GarmentError> {
        super::check(options)?;
        check_arrays(flat, draped, triangles)?;
        let faces =
            (1..).take(triangles.len()).map(|line| Face { line, corners: 3, label: 0 }).collect();
        let triangles = Arc::new(triangles.to_vec());
        let mesh = ObjMesh {
            positions: Arc::new(draped.to_vec()),
            texture: Arc::new(flat.iter().map(|p| p.extend(0.0)).collect()),
            faces,
            triangles: Arc::clone(&triangles),
            texture_triangles: triangles,
            labels: vec![Label::default()],
            ..ObjMesh::default()
        };
        GarmentFiles::pair(Path::new(ARRAYS), mesh, None)?.into_garment(options)
    }

    /// A garment from OBJ text whose `vt` are the flat pattern.
    ///
    /// # Errors
    /// As of [`super::read`]; messages call the text `FLAT.obj`.
    ///
    /// ```
    /// use warpknit_core::garment::{Garment, ReadOptions};
    /// let text = b"v 0 0 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    /// let garment = Garment::read_obj(&text[..], &ReadOptions::default())?;
    /// assert_eq!(garment.summary.unit, "m");
    /// # Ok::<(), warpknit_core::garment::GarmentError>(())
    /// ```
    pub fn read_obj(text: impl BufRead, options: &ReadOptions) -> Result<Self, GarmentError> {
        super::check(options)?;
        let path = Path::new(FLAT);
        GarmentFiles::pair(path, obj::parse(text, path)?, None)?.into_garment(options)
    }

    /// A garment from a flat and a draped OBJ text with the same faces in the same order.
    ///
    /// # Errors
    /// As of [`super::read`]; messages call the texts `FLAT.obj` and `DRAPED.obj`.
    ///
    /// ```
    /// use warpknit_core::garment::{Garment, ReadOptions};
    /// let flat = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    /// let draped = b"v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n";
    /// let garment = Garment::read_obj_pair(&flat[..], &draped[..], &ReadOptions::default())?;
    /// assert_eq!(garment.panels.len(), 1);
    /// # Ok::<(), warpknit_core::garment::GarmentError>(())
    /// ```
    pub fn read_obj_pair(
        flat: impl BufRead,
        draped: impl BufRead,
        options: &ReadOptions,
    ) -> Result<Self, GarmentError> {
        super::check(options)?;
        let paths = [FLAT, DRAPED].map(Path::new);
        let (flat, draped) = (obj::parse(flat, paths[0])?, obj::parse(draped, paths[1])?);
        GarmentFiles::pair(paths[0], flat, Some((paths[1], draped)))?.into_garment(options)
    }
}

/// Refuses arrays that don't belong together.
fn check_arrays(
    flat: &[DVec2],
    draped: &[DVec3],
    triangles: &[[u32; 3]],
) -> Result<(), ArrayFault> {
    if triangles.is_empty() {
        return Err(ArrayFault::Empty);
    }
    if flat.len() != draped.len() {
        return Err(ArrayFault::Lengths { flat: flat.len(), draped: draped.len() });
    }
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&vertex| vertex as usize >= flat.len()) {
            return Err(ArrayFault::Index { triangle, vertex, vertices: flat.len() });
        }
    }
    let is_finite = |vertex: &usize| flat[*vertex].is_finite() && draped[*vertex].is_finite();
    match (0..flat.len()).find(|vertex| !is_finite(vertex)) {
        Some(vertex) => Err(ArrayFault::NotFinite { vertex }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT_SQUARE: [DVec2; 3] = [DVec2::ZERO, DVec2::new(10.0, 0.0), DVec2::new(0.0, 10.0)];

    #[test]
    fn arrays_that_do_not_belong_together_are_refused_in_one_line() {
        let draped = FLAT_SQUARE.map(|p| p.extend(0.0));
        let faults = [
            Garment::from_arrays(&FLAT_SQUARE, &draped[..2], &[[0, 1, 2]]),
            Garment::from_arrays(&FLAT_SQUARE, &draped, &[[0, 1, 3]]),
            Garment::from_arrays(&FLAT_SQUARE, &[DVec3::NAN; 3], &[[0, 1, 2]]),
            Garment::from_arrays(&FLAT_SQUARE, &draped, &[]),
            Garment::from_arrays(&FLAT_SQUARE, &draped.map(|p| p * 1e13), &[[0, 1, 2]]),
        ];
        for fault in faults {
            let message = fault.unwrap_err().to_string();
            assert!(message.contains("arrays") && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn text_and_arrays_give_the_same_panel() {
        let draped = [DVec3::ZERO, DVec3::X * 10.0, DVec3::new(0.0, 6.0, 8.0)];
        let arrays = Garment::from_arrays(&FLAT_SQUARE, &draped, &[[0, 1, 2]]).unwrap();
        let text = "v 0 0 0\nv 10 0 0\nv 0 6 8\nvt 0 0\nvt 10 0\nvt 0 10\nf 1/1 2/2 3/3\n";
        let options =
            ReadOptions { unit: Some(Unit::Mm), uv_scale: Some(1.0), ..ReadOptions::default() };
        let read = Garment::read_obj(text.as_bytes(), &options).unwrap();
        assert_eq!(arrays.panels[0].uv, read.panels[0].uv);
        assert_eq!(arrays.panels[0].draped, read.panels[0].draped);
    }
}
