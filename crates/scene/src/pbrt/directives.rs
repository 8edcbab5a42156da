//! Directives of a scene description → [`Description`]: entities with the state in force.

use std::{collections::HashMap, path::Path, rc::Rc};

use glam::{DMat4, DVec3};

use super::{
    parameters::{Entity, Log, Parameter, read_parameters},
    state::{MaterialChoice, Saved, State, States, look_at},
    tokens::{Part, Place, Source, Token},
};
use crate::{beside::Folder, error::Result, features};

/// Shape with the state in force at its directive.
#[derive(Debug)]
pub(super) struct Shape {
    pub entity: Entity,
    /// Its matrix is world, or object of instances, from shape.
    pub state: State,
}

/// Use of an object.
#[derive(Debug)]
pub(super) struct Instance {
    /// World from the world of the object's definition.
    pub world_from_object: DMat4,
    pub place: Place,
}

/// Object that may be used many times.
#[derive(Debug, Default)]
pub(super) struct Object {
    pub name: String,
    pub shapes: Vec<Shape>,
    pub instances: Vec<Instance>,
    /// True once `ObjectBegin` has named it.
    pub is_defined: bool,
}

/// Entities of a scene.
#[derive(Debug, Default)]
pub(super) struct Description {
    /// `Camera`, and camera from world.
    pub camera: Option<(Entity, DMat4)>,
    pub film: Option<Entity>,
    /// `PixelFilter`.
    pub filter: Option<Entity>,
    pub integrator: Option<Entity>,
    pub sampler: Option<Entity>,
    /// `Texture` by its name, those of type `float` apart from those of type `spectrum`.
    pub textures: HashMap<(bool, String), Entity>,
    /// `MakeNamedMaterial`.
    pub materials: HashMap<String, Entity>,
    /// `MakeNamedMedium`.
    pub media: HashMap<String, Entity>,
    /// Shapes that are no part of an object, in order.
    pub shapes: Vec<Shape>,
    /// Objects in the order in which they are named.
    pub objects: Vec<Object>,
    /// `LightSource`, and world from light.
    pub lights: Vec<(Entity, DMat4)>,
}

pub(super) struct Reader<'a> {
    source: Source,
    states: States,
    in_world: bool,
    /// Object between `ObjectBegin` and `ObjectEnd`.
    object: Option<usize>,
    object_names: HashMap<String, usize>,
    description: Description,
    log: Log<'a>,
}

impl<'a> Reader<'a> {
    /// Reads all directives of the main file `main`, whose names of files start in `folder`.
    pub(super) fn read(main: &'a Path, folder: Folder) -> Result<(Description, Log<'a>)> {
        let mut reader = Self {
            states: States::default(),
            in_world: false,
            object: None,
            object_names: HashMap::new(),
            description: Description::default(),
            log: Log::new(main, folder.clone()),
            source: Source::open(main, folder)?,
        };
        loop {
            match reader.source.next()? {
                Part::Token(Token::Word) => {
                    let place = reader.source.place();
                    let name = reader.source.text().to_owned();
                    reader.directive(&name, place)?;
                }
                Part::Token(_) => {
                    let found = reader.source.text();
                    let message = format!("expected a directive, found {found:?} in its place");
                    return Err(reader.source.place().error(message));
                }
                Part::EndOfImport => {
                    let place = reader.source.place();
                    reader.states.restore(Saved::Import, &place)?;
                }
                Part::End => break,
            }
        }
        reader.states.check_end()?;
        if !reader.in_world {
            let message = "the file ends before WorldBegin: expected a scene of pbrt-v4";
            return Err(reader.source.place().error(message));
        }
        Ok((reader.description, Log { inputs: reader.source.inputs, ..reader.log }))
    }

    fn directive(&mut self, name: &str, place: Place) -> Result<()> {
        match name {
            "Identity" | "Translate" | "Scale" | "Rotate" | "LookAt" | "Transform"
            | "ConcatTransform" | "CoordinateSystem" | "CoordSysTransform" | "ActiveTransform"
            | "TransformTimes" => self.transformation(name, &place),
            // Since version 4 they are the same.
            "AttributeBegin" | "TransformBegin" => self.states.save(Saved::AttributeBegin, place),
            "AttributeEnd" | "TransformEnd" => self.states.restore(Saved::AttributeBegin, &place),
            "Attribute" => {
                let target = self.text(name)?;
                let parameters = read_parameters(&mut self.source)?;
                self.states.now.attributes.add(&target, parameters, &place)
            }
            "ReverseOrientation" => {
                self.states.now.reverse ^= true;
                Ok(())
            }
            "Include" | "Import" => {
                let file = self.text(name)?;
                let restores = name == "Import";
                if restores {
                    self.check_world(name, &place)?;
                    self.states.save(Saved::Import, place.clone())?;
                }
                self.source.include(&file, restores, &place)
            }
            "WorldBegin" => {
                if std::mem::replace(&mut self.in_world, true) {
                    return Err(place.error("a second WorldBegin"));
                }
                (self.states.now.ctm, self.states.now.at_end) = (DMat4::IDENTITY, false);
                self.states.named.insert("world".to_owned(), DMat4::IDENTITY);
                Ok(())
            }
            "ObjectBegin" | "ObjectEnd" | "ObjectInstance" => self.object(name, place),
            "Camera" | "Film" | "PixelFilter" | "Integrator" | "Sampler" | "Accelerator"
            | "Option" | "ColorSpace" => self.option(name, place),
            "Shape" | "LightSource" | "AreaLightSource" | "Material" | "NamedMaterial"
            | "MakeNamedMaterial" | "MakeNamedMedium" | "Texture" => {
                if !matches!(name, "MakeNamedMaterial" | "MakeNamedMedium" | "Texture") {
                    self.check_world(name, &place)?;
                }
                self.entity(name, place)
            }
            "MediumInterface" => {
                let inside = self.text(name)?;
                self.states.now.interior = Some(inside).filter(|name| !name.is_empty());
                // The outside may be left out, and is then as the inside.
                let token = self.source.next_here()?;
                if let Some(token) = token.filter(|token| *token == Token::Word) {
                    self.source.hold(token);
                } else if token.is_some() && !self.source.text().is_empty() {
                    self.log.ignore(features::PBRT_MEDIUM, &place);
                }
                Ok(())
            }
            _ => Err(place.error(format!(
                "unknown directive `{name}`; files of pbrt-v3 are converted by `pbrt --upgrade`"
            ))),
        }
    }

    fn check_world(&self, name: &str, place: &Place) -> Result<()> {
        if self.in_world {
            return Ok(());
        }
        Err(place.error(format!("{name} before WorldBegin")))
    }

    /// Reads a string in quotes.
    fn text(&mut self, directive: &str) -> Result<String> {
        match self.source.next_here()? {
            Some(Token::Text) => Ok(self.source.text().to_owned()),
            found => {
                let found =
                    if found.is_some() { self.source.text() } else { "the end of the file" };
                let message = format!("{directive}: expected a string in quotes, found {found}");
                Err(self.source.place().error(message))
            }
        }
    }

    /// Reads numbers, in brackets or not.
    fn numbers<const N: usize>(&mut self, directive: &str) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        let mut token = self.source.next_here()?;
        let in_brackets = token == Some(Token::Open);
        if in_brackets {
            token = self.source.next_here()?;
        }
        for (index, number) in numbers.iter_mut().enumerate() {
            if index > 0 {
                token = self.source.next_here()?;
            }
            let text = self.source.text();
            let parsed = text.parse().ok().filter(|number: &f64| number.is_finite());
            match (token, parsed) {
                (Some(Token::Word), Some(parsed)) => *number = parsed,
                (token, _) => {
                    let found = if token.is_some() { text } else { "the end of the file" };
                    let message = format!("{directive}: expected {N} numbers, found `{found}`");
                    return Err(self.source.place().error(message));
                }
            }
        }
        if in_brackets && self.source.next_here()? != Some(Token::Close) {
            let message = format!("{directive}: expected {N} numbers and a closing bracket");
            return Err(self.source.place().error(message));
        }
        Ok(numbers)
    }

    fn transformation(&mut self, name: &str, place: &Place) -> Result<()> {
        let ctm = self.states.now.ctm;
        let moved = match name {
            "Identity" => DMat4::IDENTITY,
            "Translate" => ctm * DMat4::from_translation(DVec3::from_array(self.numbers(name)?)),
            "Scale" => ctm * DMat4::from_scale(DVec3::from_array(self.numbers(name)?)),
            "Rotate" => {
                let [angle_deg, x, y, z] = self.numbers(name)?;
                let axis = DVec3::new(x, y, z).try_normalize();
                let axis =
                    axis.ok_or_else(|| place.error("Rotate: expected an axis with a direction"))?;
                ctm * DMat4::from_axis_angle(axis, angle_deg.to_radians())
            }
            "LookAt" => {
                let [a, b, c, d, e, f, g, h, i] = self.numbers(name)?;
                let view = look_at(DVec3::new(a, b, c), DVec3::new(d, e, f), DVec3::new(g, h, i));
                let message =
                    "LookAt: eye and target must differ, and up must not lie between them";
                ctm * view.ok_or_else(|| place.error(message))?
            }
            // Files give matrices column by column.
            "Transform" => DMat4::from_cols_array(&self.numbers(name)?),
            "ConcatTransform" => ctm * DMat4::from_cols_array(&self.numbers(name)?),
            "CoordinateSystem" => {
                let system = self.text(name)?;
                self.states.named.insert(system, ctm);
                ctm
            }
            "CoordSysTransform" => {
                let system = self.text(name)?;
                let known = self.states.named.get(&system).copied();
                let message = || place.error(format!("there is no coordinate system `{system}`"));
                known.ok_or_else(message)?
            }
            "TransformTimes" => {
                self.numbers::<2>(name)?;
                self.log.ignore(features::PBRT_MOTION, place);
                ctm
            }
            _ => {
                let token = self.source.next_here()?;
                let which = self.source.text().to_owned();
                if token != Some(Token::Word)
                    || !["All", "StartTime", "EndTime"].contains(&which.as_str())
                {
                    let message = "ActiveTransform: expected All, StartTime or EndTime";
                    return Err(self.source.place().error(message));
                }
                if which != "All" {
                    self.log.ignore(features::PBRT_MOTION, place);
                }
                self.states.now.at_end = which == "EndTime";
                ctm
            }
        };
        if !self.states.now.at_end {
            self.states.now.ctm = moved;
        }
        if moved.is_finite() {
            return Ok(());
        }
        Err(place.error(format!("{name}: the transformation leaves the range of numbers")))
    }

    fn object(&mut self, directive: &str, place: Place) -> Result<()> {
        self.check_world(directive, &place)?;
        if directive == "ObjectEnd" {
            self.object = None;
            return self.states.restore(Saved::ObjectBegin, &place);
        }
        let name = self.text(directive)?;
        if self.object.is_some() {
            return Err(place.error(format!("{directive} `{name}` inside an object")));
        }
        let objects = &mut self.description.objects;
        let index = *self.object_names.entry(name.clone()).or_insert(objects.len());
        if index == objects.len() {
            objects.push(Object { name: name.clone(), ..Object::default() });
        }
        let object = &mut objects[index];
        if directive == "ObjectInstance" {
            let world_from_object = self.states.now.ctm;
            object.instances.push(Instance { world_from_object, place });
            return Ok(());
        }
        if std::mem::replace(&mut object.is_defined, true) {
            return Err(place.error(format!("object `{name}` is defined twice")));
        }
        self.object = Some(index);
        self.states.save(Saved::ObjectBegin, place)
    }

    /// Reads a directive of the part before `WorldBegin`.
    fn option(&mut self, name: &str, place: Place) -> Result<()> {
        if name == "Option" {
            let name = self.text(name)?;
            let name = format!("Option `{}`", name.split_whitespace().last().unwrap_or_default());
            self.log.ignore_named(features::PBRT_OPTION, &name, &place);
            // Its value is a word or a string, in brackets or not.
            let mut token = self.source.next_here()?;
            if token == Some(Token::Open) {
                while !matches!(token, Some(Token::Close) | None) {
                    token = self.source.next_here()?;
                }
            }
            let error = || self.source.place().error(format!("{name}: expected its value"));
            return token.map(drop).ok_or_else(error);
        }
        let kind = self.text(name)?;
        if name == "ColorSpace" {
            if kind != "srgb" {
                let name = format!("ColorSpace `{kind}`");
                self.log.ignore_named(features::PBRT_COLOR_SPACE, &name, &place);
            }
            return Ok(());
        }
        if self.in_world {
            return Err(place.error(format!("{name} after WorldBegin")));
        }
        let read = |directive| Entity::read(&mut self.source, directive, kind, place, &[]);
        match name {
            "Camera" => {
                let ctm = self.states.now.ctm;
                self.states.named.insert("camera".to_owned(), ctm.inverse());
                self.description.camera = Some((read("Camera")?, ctm));
            }
            "Film" => self.description.film = Some(read("Film")?),
            "PixelFilter" => self.description.filter = Some(read("PixelFilter")?),
            "Integrator" => self.description.integrator = Some(read("Integrator")?),
            "Sampler" => self.description.sampler = Some(read("Sampler")?),
            // The renderer has its own tree.
            _ => drop(read("Accelerator")?),
        }
        Ok(())
    }

    fn entity(&mut self, name: &str, place: Place) -> Result<()> {
        let kind = self.text(name)?;
        let now = self.states.now.clone();
        let mut read = |directive, target, kind, place| {
            Entity::read(&mut self.source, directive, kind, place, now.attributes.of(target))
        };
        match name {
            "NamedMaterial" => {
                self.states.now.material = MaterialChoice::Named(Rc::from(kind), place);
            }
            "Shape" => {
                let shape = Shape { entity: read("Shape", "shape", kind, place)?, state: now };
                match self.object {
                    Some(index) => self.description.objects[index].shapes.push(shape),
                    None => self.description.shapes.push(shape),
                }
            }
            "LightSource" => {
                let entity = read("LightSource", "light", kind, place)?;
                self.description.lights.push((entity, now.ctm));
            }
            "AreaLightSource" => {
                let entity = read("AreaLightSource", "light", kind, place)?;
                self.states.now.area_light = Some(Rc::new(entity));
            }
            "Material" => {
                let entity = read("Material", "material", kind, place)?;
                self.states.now.material = MaterialChoice::Own(Rc::new(entity));
            }
            "MakeNamedMaterial" => {
                let entity = read("MakeNamedMaterial", "material", kind.clone(), place)?;
                let error = entity.error("the name is taken by another material");
                if self.description.materials.insert(kind, entity).is_some() {
                    return Err(error);
                }
            }
            "MakeNamedMedium" => {
                let entity = read("MakeNamedMedium", "medium", kind.clone(), place)?;
                self.description.media.insert(kind, entity);
            }
            _ => self.texture(kind, place, now.attributes.of("texture"))?,
        }
        Ok(())
    }

    /// Reads `Texture "name" "float" "imagemap"` from its second string on.
    fn texture(&mut self, name: String, place: Place, inherited: &[Parameter]) -> Result<()> {
        let values = self.text("Texture")?;
        let kind = self.text("Texture")?;
        let entity = Entity::read(&mut self.source, "Texture", kind, place, inherited)?;
        if !["float", "spectrum"].contains(&values.as_str()) {
            let message = format!(
                "`{name}`: expected values of float or spectrum, found {values}; files of pbrt-v3 are \
                 converted by `pbrt --upgrade`"
            );
            return Err(entity.error(message));
        }
        let error = entity.error(format!("the name `{name}` is taken by another texture"));
        if self.description.textures.insert((values == "float", name), entity).is_some() {
            return Err(error);
        }
        Ok(())
    }
}
