//! USD to a triangulated mesh (OpenUSD 24.08): text (`text`), crate files (`crate_file`), and either
//! in a `.usdz` (`package`).
//!
//! In: a file's bytes and a time. Out: an [`ObjMesh`] with the faces of all `Mesh` prims, moved by the
//! transforms above them, with y up, and the length of a stage's unit. The flat pattern is the
//! first texture coordinate primvar, `primvars:st` before others. Where attributes have time samples,
//! they are those of that time (`samples`), and without one the first. [`times`] lists them.
//!
//! Method: either reader gives the prims as a [`UsdStage`]; meshes are taken from it here. Prims that
//! are inactive, invisible, guides, proxies, `over` or `class` are left out.
//!
//! Not promised: composition. References, payloads and variants are not followed; where a stage
//! has them and no mesh of its own, the error says how to flatten it.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3};

use super::Unit;
use super::obj::ObjMesh;
use super::soup::Soup;

mod crate_file;
pub(super) mod package;
mod packed;
mod samples;
mod text;
mod values;

/// How deep prims may lie in each other.
const DEEPEST: usize = 128;
/// What to do with a file that isn't understood.
const CONVERT: &str = "export it again, or flatten it with `usdcat --flatten`";
/// Millimetres from metres.
const METRE: f64 = 1000.0;

/// A stage, as much of it as a mesh needs.
#[derive(Debug, Default)]
struct UsdStage {
    /// `Y` where it isn't said.
    up: String,
    metres_per_unit: Option<f64>,
    prims: Vec<Prim>,
}

/// A prim with what is in it.
#[derive(Debug, Default)]
struct Prim {
    name: String,
    /// `Mesh`, `Xform`.
    kind: String,
    /// Whether it is left out, with what is in it.
    is_hidden: bool,
    /// Whether part of it is in another file or in a variant.
    is_composed: bool,
    attributes: Vec<Attribute>,
    children: Vec<Self>,
}

/// An attribute.
#[derive(Debug, Default)]
struct Attribute {
    name: String,
    /// `texCoord2f[]`.
    kind: String,
    value: UsdValue,
    /// The times of its samples, if the value is one of them.
    times: Vec<f64>,
    interpolation: String,
}

/// A value's numbers or texts, in order, whatever lists and tuples they are in.
#[derive(Clone, Debug, Default, PartialEq)]
struct UsdValue {
    numbers: Vec<f64>,
    texts: Vec<String>,
}

/// Whether a mesh is made of the attribute of that name. Others are read over.
fn is_needed(name: &str) -> bool {
    const NAMES: [&str; 7] = [
        "points",
        "faceVertexCounts",
        "faceVertexIndices",
        "orientation",
        "purpose",
        "visibility",
        "xformOpOrder",
    ];
    NAMES.contains(&name) || name.starts_with("primvars:") || name.starts_with("xformOp:")
}

/// Reads the bytes of any USD file.
///
/// # Errors
/// What is wrong with them.
pub(super) fn parse(bytes: &[u8], time: Option<f64>) -> Result<ObjMesh, String> {
    mesh(stage(bytes, time)?)
}

/// The times of all samples that meshes and their transforms have, in order.
///
/// # Errors
/// What is wrong with the bytes.
pub(super) fn times(bytes: &[u8]) -> Result<Vec<f64>, String> {
    fn add(prim: &Prim, times: &mut Vec<f64>) {
        let moving = prim.attributes.iter().filter(|own| samples::is_smooth(&own.name));
        times.extend(moving.flat_map(|own| &own.times));
        prim.children.iter().for_each(|child| add(child, times));
    }
    let mut times = Vec::new();
    stage(bytes, None)?.prims.iter().for_each(|prim| add(prim, &mut times));
    times.retain(|time| time.is_finite());
    times.sort_by(f64::total_cmp);
    times.dedup();
    Ok(times)
}

fn stage(bytes: &[u8], time: Option<f64>) -> Result<UsdStage, String> {
    if package::is_package(bytes) {
        return plain_stage(package::first(bytes)?, time);
    }
    plain_stage(bytes, time)
}

/// A stage that is in no package.
fn plain_stage(bytes: &[u8], time: Option<f64>) -> Result<UsdStage, String> {
    if bytes.starts_with(b"PXR-USDC") {
        crate_file::stage(bytes, time)
    } else {
        text::stage(bytes, time)
    }
}

fn mesh(stage: UsdStage) -> Result<ObjMesh, String> {
    let metres = stage.metres_per_unit.filter(|metres| metres.is_finite() && *metres > 0.0);
    let unit = metres.map(|metres| {
        let is_near = |unit: &Unit| (metres * METRE / unit.millimetres() - 1.0).abs() < 1e-6;
        Unit::ALL.into_iter().find(is_near).ok_or(metres)
    });
    // A stage in a unit that has no name is scaled to metres.
    let (unit, size) = match unit {
        None => (None, 1.0),
        Some(Ok(unit)) => (Some(unit), 1.0),
        Some(Err(metres)) => (Some(Unit::M), metres),
    };
    let upright = match stage.up.as_str() {
        "Z" => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        _ => DMat3::IDENTITY,
    };
    let root = DAffine3::from_mat3(upright * size);
    let mut meshes = Meshes { soup: Soup::default(), is_composed: false, root };
    for prim in &stage.prims {
        meshes.add(prim, root)?;
    }
    let Some(mesh) = meshes.soup.into_mesh() else {
        return Err(if meshes.is_composed {
            "has no mesh of its own, but references, payloads or variants: flatten it with \
             `usdcat --flatten`"
                .to_owned()
        } else {
            "has no mesh: export the garment as a mesh".to_owned()
        });
    };
    Ok(ObjMesh { unit, ..mesh })
}

/// Meshes as they are found.
#[derive(Debug)]
struct Meshes {
    soup: Soup,
    is_composed: bool,
    /// From the stage's axes and unit to those of the mesh.
    root: DAffine3,
}

impl Meshes {
    fn add(&mut self, prim: &Prim, parent: DAffine3) -> Result<(), String> {
        self.is_composed |= prim.is_composed;
        let is_out =
            |name, values: &[&str]| prim.text(name).is_some_and(|value| values.contains(&value));
        if prim.is_hidden
            || is_out("visibility", &["invisible"])
            || is_out("purpose", &["guide", "proxy"])
        {
            return Ok(());
        }
        let wrong = |what| format!("its prim {:?} {what}", prim.name);
        let own = transform(prim).ok_or_else(|| wrong("has a wrong transform".to_owned()))?;
        let stage_from_prim = match own {
            Own::Within(own) => parent * own,
            Own::Alone(own) => self.root * own,
        };
        if prim.kind == "Mesh" {
            self.soup.begin(&prim.name);
            add_faces(&mut self.soup, prim, stage_from_prim).map_err(wrong)?;
        }
        prim.children.iter().try_for_each(|child| self.add(child, stage_from_prim))
    }
}

/// Adds the faces of a mesh.
fn add_faces(soup: &mut Soup, prim: &Prim, stage_from_prim: DAffine3) -> Result<(), String> {
    let numbers = |name| prim.attribute(name).map_or(&[][..], |own| &own.value.numbers);
    let (points, rest) = numbers("points").as_chunks::<3>();
    let counts = numbers("faceVertexCounts");
    let corners = numbers("faceVertexIndices");
    let index = |number: &f64, count: usize| {
        let index = crate::number::whole_f64(*number);
        (*number >= 0.0 && index < count).then_some(index)
    };
    if !rest.is_empty() {
        return Err("has points without three coordinates: export it again".to_owned());
    }
    let points: Vec<_> = points
        .iter()
        .map(|point| stage_from_prim.transform_point3(DVec3::from_array(*point)))
        .collect();
    let pattern = UvPattern::of(prim, points.len(), corners.len())?;
    let is_left = prim.text("orientation") == Some("leftHanded");
    let is_turned = is_left != (stage_from_prim.matrix3.determinant() < 0.0);
    let mut first = 0;
    for (face, count) in counts.iter().enumerate() {
        let own =
            index(count, corners.len() + 1).and_then(|count| corners.get(first..first + count));
        let own = own.ok_or_else(|| format!("has a face {face} without its corners: {CONVERT}"))?;
        let vertices = own.iter().map(|corner| index(corner, points.len()));
        let vertices: Option<Vec<_>> = vertices.collect();
        let vertices = vertices
            .ok_or_else(|| format!("has a face {face} with a point that isn't there: {CONVERT}"))?;
        let mut places: Vec<_> = vertices.iter().map(|vertex| points[*vertex]).collect();
        let mut flat = pattern.as_ref().map(|pattern| pattern.of_face(first, &vertices));
        if is_turned {
            // The first corner stays the first, from which the triangles fan out.
            places[1..].reverse();
            if let Some(flat) = &mut flat {
                flat[1..].reverse();
            }
        }
        if !soup.add(&places, flat.as_deref()) {
            return Err(format!(
                "has a face {face} of under three corners, or of a number that is not finite"
            ));
        }
        first += own.len();
    }
    Ok(())
}

/// The flat pattern of a mesh: a texture coordinate for each point, or for each corner.
#[derive(Debug)]
struct UvPattern {
    values: Vec<DVec2>,
    is_of_corners: bool,
}

impl UvPattern {
    /// That of a prim with so many points and corners, if it has one.
    fn of(prim: &Prim, points: usize, corners: usize) -> Result<Option<Self>, String> {
        const NAMES: [&str; 5] =
            ["primvars:st", "primvars:UVMap", "primvars:uv", "primvars:map1", "primvars:st0"];
        let is_texture = |own: &&Attribute| own.kind.starts_with("texCoord2");
        let named = NAMES.iter().find_map(|name| prim.attribute(name));
        let Some(own) = named.or_else(|| prim.attributes.iter().find(is_texture)) else {
            return Ok(None);
        };
        let wrong =
            || format!("has {:?} of another length than its faces: export it again", own.name);
        let values: Vec<_> =
            own.value.numbers.as_chunks().0.iter().map(|value| DVec2::from_array(*value)).collect();
        let values = match prim.attribute(&format!("{}:indices", own.name)) {
            None => values,
            Some(indices) => {
                let value = |index: &f64| values.get(crate::number::whole_f64(*index)).copied();
                let values: Option<Vec<_>> = indices.value.numbers.iter().map(value).collect();
                values.ok_or_else(wrong)?
            }
        };
        let is_of_corners = match own.interpolation.as_str() {
            "faceVarying" => true,
            "vertex" | "varying" => false,
            // A value for the whole mesh or for a face is no pattern.
            "constant" | "uniform" => return Ok(None),
            _ => values.len() == corners,
        };
        let expected = if is_of_corners { corners } else { points };
        if values.len() == expected {
            Ok(Some(Self { values, is_of_corners }))
        } else {
            Err(wrong())
        }
    }

    /// Of a face whose first corner has that number, and whose vertices are these.
    fn of_face(&self, first: usize, vertices: &[usize]) -> Vec<DVec2> {
        if self.is_of_corners {
            self.values[first..first + vertices.len()].to_vec()
        } else {
            vertices.iter().map(|vertex| self.values[*vertex]).collect()
        }
    }
}

impl Prim {
    fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|own| own.name == name)
    }

    /// The first text of an attribute.
    fn text(&self, name: &str) -> Option<&str> {
        self.attribute(name)?.value.texts.first().map(String::as_str)
    }
}

/// A prim's own transform.
enum Own {
    /// To its parent.
    Within(DAffine3),
    /// To the stage, whatever is above it.
    Alone(DAffine3),
}

/// The transform of a prim: its operations, the first of which is applied last.
fn transform(prim: &Prim) -> Option<Own> {
    let mut own = DAffine3::IDENTITY;
    let mut is_alone = false;
    for name in prim.attribute("xformOpOrder").map_or(&[][..], |own| &own.value.texts) {
        if name == "!resetXformStack!" {
            (own, is_alone) = (DAffine3::IDENTITY, true);
            continue;
        }
        let (name, is_inverse) = match name.strip_prefix("!invert!") {
            Some(name) => (name, true),
            None => (name.as_str(), false),
        };
        let operation = operation(name, &prim.attribute(name)?.value.numbers)?;
        let operation = if is_inverse { operation.inverse() } else { operation };
        if !operation.is_finite() {
            return None;
        }
        own *= operation;
    }
    Some(if is_alone { Own::Alone(own) } else { Own::Within(own) })
}

/// An operation: `xformOp:KIND` or `xformOp:KIND:NAME`.
fn operation(name: &str, numbers: &[f64]) -> Option<DAffine3> {
    let kind = name.strip_prefix("xformOp:")?.split(':').next()?;
    let three = || <[f64; 3]>::try_from(numbers).ok().map(DVec3::from_array);
    let one = || <[f64; 1]>::try_from(numbers).ok().map(|[number]| number.to_radians());
    Some(match kind {
        "translate" => DAffine3::from_translation(three()?),
        "scale" => DAffine3::from_scale(three()?),
        "translateX" | "translateY" | "translateZ" | "scaleX" | "scaleY" | "scaleZ" => {
            let [number] = <[f64; 1]>::try_from(numbers).ok()?;
            let axis = axis(kind.chars().last()?)?;
            match kind.starts_with('t') {
                true => DAffine3::from_translation(axis * number),
                false => DAffine3::from_scale(DVec3::ONE + axis * (number - 1.0)),
            }
        }
        "rotateX" | "rotateY" | "rotateZ" => {
            DAffine3::from_axis_angle(axis(kind.chars().last()?)?, one()?)
        }
        // Turned about the first axis first.
        "rotateXYZ" | "rotateXZY" | "rotateYXZ" | "rotateYZX" | "rotateZXY" | "rotateZYX" => {
            let angles = three()?;
            let mut turn = DQuat::IDENTITY;
            for letter in kind["rotate".len()..].chars() {
                let axis = axis(letter)?;
                turn = DQuat::from_axis_angle(axis, angles.dot(axis).to_radians()) * turn;
            }
            DAffine3::from_quat(turn)
        }
        "orient" => {
            let [w, x, y, z] = <[f64; 4]>::try_from(numbers).ok()?;
            let turn = DQuat::from_xyzw(x, y, z, w);
            (turn.length() > 0.0).then(|| DAffine3::from_quat(turn.normalize()))?
        }
        // Rows in the file, for points on the left: columns here.
        "transform" => {
            let matrix = DMat4::from_cols_array(&<[f64; 16]>::try_from(numbers).ok()?);
            DAffine3::from_mat4(matrix)
        }
        _ => return None,
    })
}

fn axis(letter: char) -> Option<DVec3> {
    match letter {
        'X' => Some(DVec3::X),
        'Y' => Some(DVec3::Y),
        'Z' => Some(DVec3::Z),
        _ => None,
    }
}
