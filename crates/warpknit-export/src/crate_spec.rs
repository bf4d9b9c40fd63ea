//! The tree of a USD stage, to be written as a crate file: prims, their properties, and the values
//! of fields, with the words that stand for values in the file.

/// Marks a value as an array.
const ARRAY: u64 = 1 << 63;
/// Marks a value that stands in its own word.
pub(super) const INLINED: u64 = 1 << 62;
/// Marks an array of coded integers.
const CODED: u64 = 1 << 61;

/// A type of values, by its number in the file.
#[derive(Clone, Copy, Debug)]
pub(super) enum CrateType {
    Int = 3,
    Float = 8,
    Double = 9,
    Token = 11,
    Vec2f = 20,
    Vec3f = 24,
    TokenListOp = 32,
    PathListOp = 34,
    TokenVector = 41,
    Specifier = 42,
    Variability = 44,
    TimeSamples = 46,
    DoubleVector = 48,
    String = 10,
}

/// A value in the file, or where it lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Word(pub(super) u64);

impl Word {
    pub(super) fn new(kind: CrateType, payload: u64, marks: u64) -> Self {
        Self(marks | (kind as u64) << 48 | payload)
    }

    /// An array of that kind at that place; `None` for an empty one.
    pub(super) fn array(kind: CrateType, at: Option<u64>, is_coded: bool) -> Self {
        Self::new(kind, at.unwrap_or(0), if is_coded { ARRAY | CODED } else { ARRAY })
    }
}

/// A value of a field.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// An array that was written before.
    Array(Word),
    /// Arrays that were written before, with their times.
    Samples(Vec<(f64, Word)>),
    Double(f64),
    Float(f32),
    Int(i32),
    Vec3f([f32; 3]),
    Token(String),
    String(String),
    /// Tokens in front of those of other layers: `apiSchemas`.
    Prepended(Vec<&'static str>),
    /// Paths alone: targets and connections.
    Paths(Vec<String>),
    /// The opinion that a prim exists (`def`).
    Defined,
    /// The value of all times.
    Uniform,
}

/// What a spec is, by its number in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpecKind {
    Attribute = 1,
    Prim = 6,
    Root = 7,
    Relationship = 8,
}

/// A prim or a property, with what it contains.
#[derive(Clone, Debug)]
pub(super) struct Spec {
    pub(super) name: String,
    pub(super) kind: SpecKind,
    pub(super) fields: Vec<(&'static str, Value)>,
    pub(super) children: Vec<Self>,
}

impl Spec {
    /// The root, with the stage's metadata.
    pub(super) fn root(fields: Vec<(&'static str, Value)>, children: Vec<Self>) -> Self {
        Self { name: String::new(), kind: SpecKind::Root, fields, children }
    }

    /// A prim with the prims and properties in it.
    pub(super) fn prim(
        name: impl Into<String>,
        type_name: &str,
        schemas: Vec<&'static str>,
        children: Vec<Self>,
    ) -> Self {
        let mut fields =
            vec![("specifier", Value::Defined), ("typeName", Value::Token(type_name.to_owned()))];
        if !schemas.is_empty() {
            fields.push(("apiSchemas", Value::Prepended(schemas)));
        }
        Self { name: name.into(), kind: SpecKind::Prim, fields, children }
    }

    /// An attribute of that type.
    pub(super) fn attribute(name: &str, type_name: &str, value: Option<Value>) -> Self {
        let mut fields = vec![("typeName", Value::Token(type_name.to_owned()))];
        if let Some(value) = value {
            let is_sampled = matches!(value, Value::Samples(_));
            fields.push((if is_sampled { "timeSamples" } else { "default" }, value));
        }
        Self { name: name.to_owned(), kind: SpecKind::Attribute, fields, children: Vec::new() }
    }

    /// A token attribute of one value for all times.
    pub(super) fn uniform(name: &str, value: &str) -> Self {
        let spec = Self::attribute(name, "token", Some(Value::Token(value.to_owned())));
        spec.with("variability", Value::Uniform)
    }

    /// A relationship to one target.
    pub(super) fn relationship(name: &str, target: String) -> Self {
        let fields =
            vec![("variability", Value::Uniform), ("targetPaths", Value::Paths(vec![target]))];
        Self { name: name.to_owned(), kind: SpecKind::Relationship, fields, children: Vec::new() }
    }

    /// The same with another field.
    pub(super) fn with(mut self, field: &'static str, value: Value) -> Self {
        self.fields.push((field, value));
        self
    }

    /// The same with its interpolation.
    pub(super) fn interpolated(self, interpolation: &str) -> Self {
        self.with("interpolation", Value::Token(interpolation.to_owned()))
    }

    pub(super) fn is_property(&self) -> bool {
        matches!(self.kind, SpecKind::Attribute | SpecKind::Relationship)
    }

    /// The path of a child of the spec at `path`.
    pub(super) fn child_path(path: &str, child: &Self) -> String {
        let separator = match (child.is_property(), path) {
            (true, _) => ".",
            (false, "/") => "",
            (false, _) => "/",
        };
        format!("{path}{separator}{}", child.name)
    }
}
