//! TOML tables → entries.
//!
//! Materials and objects are tagged by `type` and `shape`. Their tables are split into the keys
//! that all kinds share and the keys of one kind, so that a key of another kind is rejected too.

use std::ops::Range;

use serde::{
    Deserializer,
    de::{DeserializeOwned, Error as _, Visitor, value},
    forward_to_deserialize_any,
};
use toml::{
    Spanned,
    de::{DeTable, DeValue, ValueDeserializer},
};

use super::{
    Entry, LampKeys, LampKindEntry, MaterialKeys, MaterialKindEntry, ObjectKeys, ObjectSource,
    SceneFile,
};
use crate::{
    error::{Result, TextError, line_and_column},
    shapes::{self, Shape},
};

pub(super) fn read_root(text: &str) -> Result<SceneFile, TextError> {
    let root = DeTable::parse(text)?;
    let span = root.span();
    let mut table = root.into_inner();
    let known =
        ["camera", "film", "environment", "lamp", "portal", "material", "object", "include"];
    refuse_unknown_keys(&table, &known, "the scene")?;
    let mut array = |key| take_array(&mut table, key);
    let (lamps, portals, materials) = (array("lamp")?, array("portal")?, array("material")?);
    let (objects, includes) = (array("object")?, array("include")?);
    let keyframes = match table.get_mut("camera").map(Spanned::get_mut) {
        Some(DeValue::Table(camera)) => take_array(camera, "keyframe")?,
        _ => Vec::new(),
    };
    let mut file: SceneFile = read_table(table, span)?;
    file.keyframes = read_all(keyframes, text, |e| read_plain(e, "[[camera.keyframe]]"))?;
    file.lamps = read_all(lamps, text, read_lamp)?;
    file.portals = read_all(portals, text, |e| read_plain(e, "[[portal]]"))?;
    file.materials = read_all(materials, text, read_material)?;
    file.objects = read_all(objects, text, read_object)?;
    file.includes = read_all(includes, text, |e| read_plain(e, "[[include]]"))?;
    Ok(file)
}

fn read_all<K, V>(
    entries: Vec<Spanned<DeValue>>,
    text: &str,
    read: impl Fn(Spanned<DeValue>) -> Result<(K, V), TextError>,
) -> Result<Vec<Entry<K, V>>, TextError> {
    let read = |entry: Spanned<DeValue>| {
        let line = line_and_column(text, entry.span().start).0;
        let (keys, kind) = read(entry)?;
        Ok(Entry { line, keys, kind })
    };
    entries.into_iter().map(read).collect()
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

fn read_material(entry: Spanned<DeValue>) -> Result<(MaterialKeys, MaterialKindEntry), TextError> {
    let (keys, rest): (MaterialKeys, _) = KindTable::split(entry, "[[material]]")?;
    let type_name = keys.r#type.get_ref();
    let owner = format!("material `{}` of type `{type_name}`", keys.name);
    let kind = rest.read_kind("material type", &keys.r#type, MATERIALS, &owner)?;
    Ok((keys, kind))
}

fn read_lamp(entry: Spanned<DeValue>) -> Result<(LampKeys, LampKindEntry), TextError> {
    let (keys, rest): (LampKeys, _) = KindTable::split(entry, "[[lamp]]")?;
    let type_name = keys.r#type.get_ref();
    let label = keys.name.as_ref().map_or("lamp".to_owned(), |name| format!("lamp `{name}`"));
    let owner = format!("{label} of type `{type_name}`");
    let kind = rest.read_kind("lamp type", &keys.r#type, LAMPS, &owner)?;
    Ok((keys, kind))
}

/// Reads an entry of an array of tables that has no kinds; `header` names it.
fn read_plain<T: DeserializeOwned>(
    entry: Spanned<DeValue>,
    header: &str,
) -> Result<(T, ()), TextError> {
    let (table, span) = table_of(entry, header)?;
    Ok((read_table(table, span)?, ()))
}

/// Table of an entry, and its place; `header` names it in the message if it is not one.
fn table_of<'i>(
    entry: Spanned<DeValue<'i>>,
    header: &str,
) -> Result<(DeTable<'i>, Range<usize>), TextError> {
    let span = entry.span();
    match entry.into_inner() {
        DeValue::Table(table) => Ok((table, span)),
        _ => Err(TextError { span, message: format!("expected a table, `{header}`") }),
    }
}

fn read_object(entry: Spanned<DeValue>) -> Result<(ObjectKeys, ObjectSource), TextError> {
    let (mut keys, rest): (ObjectKeys, _) = KindTable::split(entry, "[[object]]")?;
    let label = keys.name.as_ref().map_or("object".to_owned(), |name| format!("object `{name}`"));
    let source = match (keys.mesh.take(), keys.shape.take()) {
        (Some(mesh), None) => {
            refuse_unknown_keys(&rest.table, rest.shared_keys, &format!("{label} with a mesh"))?;
            ObjectSource::Mesh(mesh)
        }
        (None, Some(shape)) => {
            let owner = format!("{label} of shape `{}`", shape.get_ref());
            let parameters = rest.read_kind("shape", &shape, SHAPES, &owner)?;
            ObjectSource::Shape { name: shape.into_inner(), shape: parameters }
        }
        (found_mesh, _) => {
            let found = if found_mesh.is_some() { "both" } else { "neither" };
            return Err(TextError {
                span: rest.span,
                message: format!("{label} needs exactly one of `mesh` and `shape`, found {found}"),
            });
        }
    };
    Ok((keys, source))
}

/// Readers of the kinds of an entry, by name.
type Kinds<T> = [(&'static str, fn(KindTable, &str) -> Result<T, TextError>)];

const MATERIALS: &Kinds<MaterialKindEntry> = &[
    ("diffuse", |rest, owner| Ok(MaterialKindEntry::Diffuse(rest.read(owner)?))),
    ("diffuse_transmission", |rest, owner| {
        Ok(MaterialKindEntry::DiffuseTransmission(rest.read(owner)?))
    }),
    ("plastic", |rest, owner| Ok(MaterialKindEntry::Plastic(rest.read(owner)?))),
    ("conductor", |rest, owner| Ok(MaterialKindEntry::Conductor(rest.read(owner)?))),
    ("principled", |rest, owner| Ok(MaterialKindEntry::Principled(rest.read(owner)?))),
    ("mirror", |rest, owner| Ok(MaterialKindEntry::Mirror(rest.read(owner)?))),
    ("dielectric", |rest, owner| Ok(MaterialKindEntry::Dielectric(rest.read(owner)?))),
    ("thin_dielectric", |rest, owner| Ok(MaterialKindEntry::ThinDielectric(rest.read(owner)?))),
    ("measured", |rest, owner| Ok(MaterialKindEntry::Measured(rest.read(owner)?))),
];

const LAMPS: &Kinds<LampKindEntry> = &[
    ("point", |rest, owner| Ok(LampKindEntry::Point(rest.read(owner)?))),
    ("spot", |rest, owner| Ok(LampKindEntry::Spot(rest.read(owner)?))),
    ("directional", |rest, owner| Ok(LampKindEntry::Directional(rest.read(owner)?))),
];

const SHAPES: &Kinds<Box<dyn Shape>> = &[
    ("box", read_shape::<shapes::RoundedBox>),
    ("sphere", read_shape::<shapes::Sphere>),
    ("cylinder", read_shape::<shapes::Cylinder>),
    ("cone", read_shape::<shapes::Cone>),
    ("torus", read_shape::<shapes::Torus>),
    ("lathe", read_shape::<shapes::Lathe>),
    ("extrude", read_shape::<shapes::Extrude>),
    ("tube", read_shape::<shapes::Tube>),
    ("blobs", read_shape::<shapes::Blobs>),
    ("grid", read_shape::<shapes::Grid>),
];

fn read_shape<S: Shape + DeserializeOwned + 'static>(
    rest: KindTable,
    owner: &str,
) -> Result<Box<dyn Shape>, TextError> {
    Ok(Box::new(rest.read::<S>(owner)?))
}

/// Keys of one kind of material or shape, beside those that all kinds share.
struct KindTable<'i> {
    table: DeTable<'i>,
    span: Range<usize>,
    shared_keys: &'static [&'static str],
}

impl KindTable<'_> {
    /// Splits the table of `entry` into the keys of `T`, which are read, and those of its kind;
    /// `header` names it in messages if it is not a table.
    fn split<'i, T: DeserializeOwned>(
        entry: Spanned<DeValue<'i>>,
        header: &str,
    ) -> Result<(T, KindTable<'i>), TextError> {
        let (all, span) = table_of(entry, header)?;
        let shared_keys = struct_fields::<T>();
        let (mut shared, mut table) = (DeTable::new(), DeTable::new());
        for (key, value) in all {
            let is_shared = shared_keys.contains(&key.get_ref().as_ref());
            if is_shared { &mut shared } else { &mut table }.insert(key, value);
        }
        Ok((read_table(shared, span.clone())?, KindTable { table, span, shared_keys }))
    }

    /// Reads the keys of the kind `name` among `kinds`; `what` and `owner` name it in messages.
    fn read_kind<T>(
        self,
        what: &str,
        name: &Spanned<String>,
        kinds: &Kinds<T>,
        owner: &str,
    ) -> Result<T, TextError> {
        if let Some((_, read)) = kinds.iter().find(|(known, _)| known == name.get_ref()) {
            return read(self, owner);
        }
        let known: Vec<_> = kinds.iter().map(|(known, _)| format!("`{known}`")).collect();
        let (name, span, known) = (name.get_ref(), name.span(), known.join(", "));
        let message = format!("unknown {what} `{name}`, expected one of {known}");
        Err(TextError { span, message })
    }

    /// Reads the keys of the kind `T`; `owner` names it in messages.
    fn read<T: DeserializeOwned>(self, owner: &str) -> Result<T, TextError> {
        let known = [self.shared_keys, struct_fields::<T>()].concat();
        refuse_unknown_keys(&self.table, &known, owner)?;
        read_table(self.table, self.span).map_err(|error| TextError {
            span: error.span,
            message: format!("{owner}: {}", error.message),
        })
    }
}

fn read_table<T: DeserializeOwned>(table: DeTable, span: Range<usize>) -> Result<T, TextError> {
    let deserializer = ValueDeserializer::from(Spanned::new(span.clone(), DeValue::Table(table)));
    T::deserialize(deserializer).map_err(|error| TextError {
        span: error.span().unwrap_or(span),
        message: error.message().to_owned(),
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
