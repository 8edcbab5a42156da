//! TOML tables → entries.
//!
//! Materials and objects are tagged by `type` and `shape`. Their tables are split into the keys
//! that all kinds share and the keys of one kind, so that a key of another kind is rejected too.

use std::path::PathBuf;

use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, Error as _, Visitor, value},
    forward_to_deserialize_any,
};
use toml::{
    Spanned,
    de::{DeTable, DeValue, ValueDeserializer},
};

use super::{
    CameraEntry, EnvironmentEntry, MaterialEntry, MaterialKindEntry, NumberOrVector, ObjectEntry,
    ObjectSource, SceneFile,
};
use crate::{
    error::{Result, TextError, line_and_column},
    scene::{
        FilmSettings,
        shapes::{self, Shape},
    },
};

/// Keys of every `[[object]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectKeys {
    name: Option<String>,
    mesh: Option<PathBuf>,
    shape: Option<Spanned<String>>,
    material: Option<String>,
    #[serde(default)]
    scale: NumberOrVector,
    #[serde(default)]
    rotate_deg: [f32; 3],
    #[serde(default)]
    translate: [f32; 3],
}

/// Keys of every `[[material]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialKeys {
    name: String,
    r#type: Spanned<String>,
}

/// Tables that have no kinds.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RootKeys {
    camera: CameraEntry,
    #[serde(default)]
    film: FilmSettings,
    environment: EnvironmentEntry,
}

/// Reads a whole scene file.
pub(super) fn read_root(text: &str) -> Result<SceneFile, TextError> {
    let root = DeTable::parse(text)?;
    let span = root.span();
    let mut table = root.into_inner();
    let known = ["camera", "film", "environment", "material", "object"];
    refuse_unknown_keys(&table, &known, "the scene")?;
    let materials = take_array(&mut table, "material")?;
    let objects = take_array(&mut table, "object")?;
    let root_keys: RootKeys = read_table(table, span)?;
    Ok(SceneFile {
        camera: root_keys.camera,
        film: root_keys.film,
        environment: root_keys.environment,
        materials: materials
            .into_iter()
            .map(|entry| read_material(entry, text))
            .collect::<Result<_, _>>()?,
        objects: objects
            .into_iter()
            .map(|entry| read_object(entry, text))
            .collect::<Result<_, _>>()?,
    })
}

/// Removes the array of tables `key` from `table`; empty if there is none.
fn take_array<'i>(
    table: &mut DeTable<'i>,
    key: &str,
) -> Result<Vec<Spanned<DeValue<'i>>>, TextError> {
    let Some(entries) = table.remove(key) else { return Ok(Vec::new()) };
    let span = entries.span();
    match entries.into_inner() {
        DeValue::Array(array) => Ok(array.into_iter().collect()),
        _ => Err(TextError { span, message: format!("expected an array of tables, `[[{key}]]`") }),
    }
}

fn read_material(entry: Spanned<DeValue>, text: &str) -> Result<MaterialEntry, TextError> {
    let line = line_and_column(text, entry.span().start).0;
    let split = SplitTable::new::<MaterialKeys>(entry, "[[material]]")?;
    let keys: MaterialKeys = read_table(split.shared, split.span.clone())?;
    let type_span = keys.r#type.span();
    let type_name = keys.r#type.into_inner();
    let rest = KindTable {
        table: split.rest,
        span: split.span,
        shared_keys: struct_fields::<MaterialKeys>(),
        owner: format!("material `{}` of type `{type_name}`", keys.name),
    };
    let kind = match type_name.as_str() {
        "diffuse" => MaterialKindEntry::Diffuse(rest.read()?),
        "plastic" => MaterialKindEntry::Plastic(rest.read()?),
        "conductor" => MaterialKindEntry::Conductor(rest.read()?),
        "measured" => MaterialKindEntry::Measured(rest.read()?),
        unknown => {
            return Err(TextError {
                span: type_span,
                message: format!(
                    "unknown material type `{unknown}`, expected one of `diffuse`, `plastic`, \
                     `conductor`, `measured`"
                ),
            });
        }
    };
    Ok(MaterialEntry { line, name: keys.name, kind })
}

fn read_object(entry: Spanned<DeValue>, text: &str) -> Result<ObjectEntry, TextError> {
    let line = line_and_column(text, entry.span().start).0;
    let split = SplitTable::new::<ObjectKeys>(entry, "[[object]]")?;
    let keys: ObjectKeys = read_table(split.shared, split.span.clone())?;
    let label = keys.name.as_ref().map_or("object".to_owned(), |name| format!("object `{name}`"));
    let source = match (keys.mesh, keys.shape) {
        (Some(mesh), None) => {
            let known = struct_fields::<ObjectKeys>();
            refuse_unknown_keys(&split.rest, known, &format!("{label} with a mesh"))?;
            ObjectSource::Mesh(mesh)
        }
        (None, Some(shape)) => {
            let shape_span = shape.span();
            let shape_name = shape.into_inner();
            let rest = KindTable {
                table: split.rest,
                span: split.span,
                shared_keys: struct_fields::<ObjectKeys>(),
                owner: format!("{label} of shape `{shape_name}`"),
            };
            let shape = read_shape(&shape_name, shape_span, rest)?;
            ObjectSource::Shape { name: shape_name, shape }
        }
        (found_mesh, _) => {
            let found = if found_mesh.is_some() { "both" } else { "neither" };
            return Err(TextError {
                span: split.span,
                message: format!("{label} needs exactly one of `mesh` and `shape`, found {found}"),
            });
        }
    };
    Ok(ObjectEntry {
        line,
        name: keys.name,
        material: keys.material,
        scale: keys.scale.0,
        rotate_deg: keys.rotate_deg,
        translate: keys.translate,
        source,
    })
}

fn read_shape(
    name: &str,
    name_span: std::ops::Range<usize>,
    rest: KindTable,
) -> Result<Box<dyn Shape>, TextError> {
    Ok(match name {
        "box" => Box::new(rest.read::<shapes::RoundedBox>()?),
        "sphere" => Box::new(rest.read::<shapes::Sphere>()?),
        "cylinder" => Box::new(rest.read::<shapes::Cylinder>()?),
        "cone" => Box::new(rest.read::<shapes::Cone>()?),
        "torus" => Box::new(rest.read::<shapes::Torus>()?),
        "lathe" => Box::new(rest.read::<shapes::Lathe>()?),
        "extrude" => Box::new(rest.read::<shapes::Extrude>()?),
        "tube" => Box::new(rest.read::<shapes::Tube>()?),
        "blobs" => Box::new(rest.read::<shapes::Blobs>()?),
        "grid" => Box::new(rest.read::<shapes::Grid>()?),
        unknown => {
            return Err(TextError {
                span: name_span,
                message: format!(
                    "unknown shape `{unknown}`, expected one of `box`, `sphere`, `cylinder`, \
                     `cone`, `torus`, `lathe`, `extrude`, `tube`, `blobs`, `grid`"
                ),
            });
        }
    })
}

/// Table split into the keys that all kinds share and the rest.
struct SplitTable<'i> {
    shared: DeTable<'i>,
    rest: DeTable<'i>,
    span: std::ops::Range<usize>,
}

impl<'i> SplitTable<'i> {
    /// Splits `entry` by the fields of `T`; `header` names it in messages if it is not a table.
    fn new<T: DeserializeOwned>(
        entry: Spanned<DeValue<'i>>,
        header: &str,
    ) -> Result<Self, TextError> {
        let span = entry.span();
        let DeValue::Table(table) = entry.into_inner() else {
            return Err(TextError { span, message: format!("expected a table, `{header}`") });
        };
        let (mut shared, mut rest) = (DeTable::new(), DeTable::new());
        for (key, value) in table {
            let is_shared = struct_fields::<T>().contains(&key.get_ref().as_ref());
            if is_shared { &mut shared } else { &mut rest }.insert(key, value);
        }
        Ok(Self { shared, rest, span })
    }
}

/// Keys of one kind of material or shape, with the context that messages need.
struct KindTable<'i> {
    table: DeTable<'i>,
    span: std::ops::Range<usize>,
    shared_keys: &'static [&'static str],
    owner: String,
}

impl KindTable<'_> {
    fn read<T: DeserializeOwned>(self) -> Result<T, TextError> {
        let known = [self.shared_keys, struct_fields::<T>()].concat();
        refuse_unknown_keys(&self.table, &known, &self.owner)?;
        read_table(self.table, self.span).map_err(|failure| TextError {
            span: failure.span,
            message: format!("{}: {}", self.owner, failure.message),
        })
    }
}

fn read_table<T: DeserializeOwned>(
    table: DeTable,
    span: std::ops::Range<usize>,
) -> Result<T, TextError> {
    let deserializer = ValueDeserializer::from(Spanned::new(span.clone(), DeValue::Table(table)));
    T::deserialize(deserializer).map_err(|error| {
        let mut failure = TextError::from(error.clone());
        if error.span().is_none() {
            failure.span = span;
        }
        failure
    })
}

fn refuse_unknown_keys(table: &DeTable, known: &[&str], owner: &str) -> Result<(), TextError> {
    for key in table.keys() {
        if !known.contains(&key.get_ref().as_ref()) {
            let known: Vec<_> = known.iter().map(|key| format!("`{key}`")).collect();
            return Err(TextError {
                span: key.span(),
                message: format!(
                    "unknown key `{}` in {owner}, expected one of {}",
                    key.get_ref(),
                    known.join(", ")
                ),
            });
        }
    }
    Ok(())
}

/// Names of the keys of a struct, as its `Deserialize` declares them.
fn struct_fields<T: DeserializeOwned>() -> &'static [&'static str] {
    struct FieldProbe<'a>(&'a mut &'static [&'static str]);

    impl<'de> Deserializer<'de> for FieldProbe<'_> {
        type Error = value::Error;

        fn deserialize_struct<V: Visitor<'de>>(
            self,
            _name: &'static str,
            fields: &'static [&'static str],
            _visitor: V,
        ) -> Result<V::Value, Self::Error> {
            *self.0 = fields;
            Err(value::Error::custom("only the names are wanted"))
        }

        fn deserialize_any<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, Self::Error> {
            Err(value::Error::custom("not a struct"))
        }

        forward_to_deserialize_any! {
            bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf
            option unit unit_struct newtype_struct seq tuple tuple_struct map enum identifier
            ignored_any
        }
    }

    let mut fields: &'static [&'static str] = &[];
    // The probe always returns an error; its result is the list it writes on the way.
    let _ = T::deserialize(FieldProbe(&mut fields));
    fields
}
