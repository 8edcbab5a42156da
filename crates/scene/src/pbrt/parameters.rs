//! Parameters of a directive: `"float radius" 2`, `"rgb L" [1 1 1]`, typed and checked; the report of
//! parts left out, and files read.

use std::{
    cell::Cell,
    path::{Path, PathBuf},
};

use glam::DVec3;

use super::tokens::{Place, Source, Token};
use crate::{
    beside::Folder,
    error::Result,
    features::{self, Feature, Ignored},
};

/// Most values of one parameter.
const MAX_VALUES: usize = 1 << 28;

/// Most parameters of one directive.
const MAX_PARAMETERS: usize = 256;

/// Type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Boolean,
    Integer,
    Float,
    /// `point2`, `vector2`
    Pair,
    /// `point3`, `vector3`, `normal`
    Triple,
    Rgb,
    /// `spectrum`: pairs of wavelength and value, or a name.
    Spectrum,
    Blackbody,
    Text,
    Texture,
}

impl Kind {
    /// Names, the one for messages first.
    const NAMES: [(Self, &[&str]); 10] = [
        (Self::Boolean, &["bool"]),
        (Self::Integer, &["integer"]),
        (Self::Float, &["float"]),
        (Self::Pair, &["point2", "vector2"]),
        (Self::Triple, &["point3", "vector3", "normal", "normal3", "point", "vector"]),
        (Self::Rgb, &["rgb"]),
        (Self::Spectrum, &["spectrum"]),
        (Self::Blackbody, &["blackbody"]),
        (Self::Text, &["string"]),
        (Self::Texture, &["texture"]),
    ];

    fn name(self) -> &'static str {
        Self::NAMES[self as usize].1[0]
    }

    /// Numbers that belong together.
    fn group(self) -> usize {
        match self {
            Self::Pair => 2,
            Self::Triple | Self::Rgb => 3,
            _ => 1,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
    Booleans(Vec<bool>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Texts(values) => values.len(),
            Self::Booleans(values) => values.len(),
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Parameter {
    pub kind: Kind,
    pub name: String,
    /// Values, at least one.
    pub values: Values,
    /// Place of type and name.
    pub place: Place,
    used: Cell<bool>,
}

impl Parameter {
    /// Numbers; empty for strings and truth values.
    pub(super) fn numbers(&self) -> &[f64] {
        if let Values::Numbers(numbers) = &self.values { numbers } else { &[] }
    }

    /// First string; empty for numbers.
    pub(super) fn text(&self) -> &str {
        if let Values::Texts(texts) = &self.values {
            texts.first().map_or("", |text| text)
        } else {
            ""
        }
    }

    /// Reads one parameter whose type and name are the last token.
    fn read(source: &mut Source) -> Result<Self> {
        let place = source.place();
        let mut words = source.text().split_ascii_whitespace();
        let (Some(type_name), Some(name), None) = (words.next(), words.next(), words.next()) else {
            let found = source.text();
            let message = format!("expected a type and a name in quotes, found {found:?}");
            return Err(place.error(message));
        };
        let mut kinds = Kind::NAMES.into_iter();
        let Some((kind, _)) = kinds.find(|(_, names)| names.contains(&type_name)) else {
            return Err(place.error(format!(
                "parameter `{name}`: unknown type `{type_name}`; expected bool, integer, float, \
                 point2, vector2, point3, vector3, normal, rgb, spectrum, blackbody, string or \
                 texture; files of pbrt-v3 are converted by `pbrt --upgrade`"
            )));
        };
        let name = name.to_owned();
        let values = read_values(source, kind, &name, &place)?;
        let (count, group) = (values.len(), kind.group());
        if count == 0 || count % group != 0 {
            let message =
                format!("parameter `{name}`: expected {group} numbers or a multiple of it");
            return Err(place.error(format!("{message}, found {count}")));
        }
        Ok(Self { kind, name, values, place, used: Cell::new(false) })
    }
}

fn read_values(source: &mut Source, kind: Kind, name: &str, place: &Place) -> Result<Values> {
    let mut values = match kind {
        Kind::Boolean => Values::Booleans(Vec::new()),
        Kind::Text | Kind::Texture => Values::Texts(Vec::new()),
        _ => Values::Numbers(Vec::new()),
    };
    let mut in_brackets = false;
    loop {
        let Some(token) = source.next_here()? else {
            return Err(
                place.error(format!("parameter `{name}`: the file ends before its values do"))
            );
        };
        match token {
            Token::Open if !in_brackets => {
                in_brackets = true;
                continue;
            }
            Token::Close if in_brackets => return Ok(values),
            Token::Word | Token::Text if values.len() < MAX_VALUES => {
                // A spectrum is numbers or a name, as its first value shows.
                if kind == Kind::Spectrum && token == Token::Text && values.len() == 0 {
                    values = Values::Texts(Vec::new());
                }
                push_value(source, token, kind, name, &mut values)?;
            }
            Token::Word | Token::Text => {
                let message = format!("parameter `{name}`: more than {MAX_VALUES} values");
                return Err(place.error(message));
            }
            Token::Open | Token::Close => {
                let expected = kind.name();
                let message = format!("parameter `{name}`: expected a {expected}, found a bracket");
                return Err(source.place().error(message));
            }
        }
        if !in_brackets {
            return Ok(values);
        }
    }
}

fn push_value(
    source: &Source,
    token: Token,
    kind: Kind,
    name: &str,
    values: &mut Values,
) -> Result<()> {
    let text = source.text();
    let is_pushed = match values {
        Values::Booleans(values) => {
            let truth: Option<bool> = text.parse().ok();
            values.extend(truth);
            truth.is_some()
        }
        Values::Texts(values) if token == Token::Text => {
            values.push(text.to_owned());
            true
        }
        Values::Numbers(values) if token == Token::Word => {
            let number = text.parse().ok().filter(|number: &f64| {
                number.is_finite() && (kind != Kind::Integer || number.fract() == 0.0)
            });
            values.extend(number);
            number.is_some()
        }
        _ => false,
    };
    if is_pushed {
        return Ok(());
    }
    let expected = match kind {
        Kind::Boolean => "true or false",
        Kind::Integer => "an integer",
        Kind::Text | Kind::Texture => "a string in quotes",
        _ => "a number",
    };
    let quote = if token == Token::Text { "the string " } else { "" };
    Err(source
        .place()
        .error(format!("parameter `{name}`: expected {expected}, found {quote}`{text}`")))
}

/// Directive with a type and parameters: `Shape "sphere" "float radius" 2`.
#[derive(Clone, Debug)]
pub(super) struct Entity {
    pub directive: &'static str,
    /// Type, such as `sphere`; the name for directives that name something.
    pub name: String,
    pub place: Place,
    parameters: Vec<Parameter>,
    /// Parameters from here on come from an `Attribute` directive.
    own: usize,
}

impl Entity {
    /// Reads the parameters that follow; `inherited` serve where the directive has none.
    pub(super) fn read(
        source: &mut Source,
        directive: &'static str,
        name: String,
        place: Place,
        inherited: &[Parameter],
    ) -> Result<Self> {
        let mut parameters = read_parameters(source)?;
        let own = parameters.len();
        parameters.extend_from_slice(inherited);
        Ok(Self { directive, name, place, parameters, own })
    }

    pub(super) fn label(&self) -> String {
        format!("{} \"{}\"", self.directive, self.name)
    }

    pub(super) fn error(&self, message: impl AsRef<str>) -> crate::error::Error {
        self.place.error(format!("{}: {}", self.label(), message.as_ref()))
    }

    pub(super) fn find(&self, name: &str) -> Option<&Parameter> {
        let found = self.parameters.iter().find(|parameter| parameter.name == name);
        found.inspect(|parameter| parameter.used.set(true))
    }

    /// Place of a parameter, if it is given.
    pub(super) fn place_of(&self, name: &str) -> Option<&Place> {
        self.find(name).map(|parameter| &parameter.place)
    }

    /// Parameter with this name, which must be of one of these types.
    pub(super) fn find_of(&self, name: &str, kinds: &[Kind]) -> Result<Option<&Parameter>> {
        let Some(found) = self.find(name) else { return Ok(None) };
        if kinds.contains(&found.kind) {
            return Ok(Some(found));
        }
        let expected: Vec<_> = kinds.iter().map(|kind| kind.name()).collect();
        Err(found.place.error(format!(
            "{}: parameter `{name}`: expected the type {}, found {}",
            self.label(),
            expected.join(" or "),
            found.kind.name()
        )))
    }

    /// All numbers of a parameter; empty if it is not given.
    pub(super) fn numbers(&self, name: &str, kind: Kind) -> Result<&[f64]> {
        Ok(self.find_of(name, &[kind])?.map_or(&[], Parameter::numbers))
    }

    /// First number of a parameter, if it is given.
    pub(super) fn optional(&self, name: &str) -> Result<Option<f64>> {
        let found = self.find_of(name, &[Kind::Float, Kind::Integer])?;
        Ok(found.and_then(|parameter| parameter.numbers().first().copied()))
    }

    pub(super) fn number(&self, name: &str, otherwise: f64) -> Result<f64> {
        Ok(self.optional(name)?.unwrap_or(otherwise))
    }

    pub(super) fn boolean(&self, name: &str, otherwise: bool) -> Result<bool> {
        let found = self.find_of(name, &[Kind::Boolean])?;
        Ok(found.map_or(otherwise, |parameter| parameter.values == Values::Booleans(vec![true])))
    }

    pub(super) fn string(&self, name: &str) -> Result<Option<&str>> {
        Ok(self.find_of(name, &[Kind::Text])?.map(Parameter::text))
    }

    pub(super) fn required(&self, name: &str) -> Result<&str> {
        self.string(name)?.ok_or_else(|| self.error(format!("expected a `{name}`")))
    }

    pub(super) fn point(&self, name: &str, otherwise: DVec3) -> Result<DVec3> {
        match self.numbers(name, Kind::Triple)? {
            [x, y, z, ..] => Ok(DVec3::new(*x, *y, *z)),
            _ => Ok(otherwise),
        }
    }

    /// Counts as asked for what changes nothing in the picture, or is named as a whole; `names` have spaces
    /// between them.
    pub(super) fn without_effect(&self, names: &str) {
        for name in names.split(' ') {
            self.find(name);
        }
    }

    /// Own parameters that nothing has asked for, the first time.
    pub(super) fn unused(&self) -> impl Iterator<Item = &Parameter> {
        self.parameters[..self.own].iter().filter(|parameter| !parameter.used.replace(true))
    }
}

/// Reads parameters up to the next word.
pub(super) fn read_parameters(source: &mut Source) -> Result<Vec<Parameter>> {
    let mut parameters: Vec<Parameter> = Vec::new();
    loop {
        match source.next_here()? {
            Some(Token::Text) => {
                let parameter = Parameter::read(source)?;
                if parameters.len() == MAX_PARAMETERS {
                    let message = format!("more than {MAX_PARAMETERS} parameters of one directive");
                    return Err(parameter.place.error(message));
                }
                // The last of a name counts; the others are unused.
                let same = parameters.iter().position(|other| other.name == parameter.name);
                parameters.push(parameter);
                if let Some(same) = same {
                    let last = parameters.len() - 1;
                    parameters.swap(same, last);
                }
            }
            Some(Token::Word) => {
                source.hold(Token::Word);
                return Ok(parameters);
            }
            Some(Token::Open | Token::Close) => {
                let message = "expected a parameter or a directive, found a bracket";
                return Err(source.place().error(message));
            }
            None => return Ok(parameters),
        }
    }
}

/// Parts of a scene that are left out, and files read.
pub(super) struct Log<'a> {
    pub main: &'a Path,
    /// Folder to which all paths are relative.
    pub folder: Folder,
    pub ignored: Ignored,
    pub inputs: Vec<PathBuf>,
    /// Warnings of the readers of other files.
    pub warnings: Vec<String>,
}

impl<'a> Log<'a> {
    pub(super) fn new(main: &'a Path, folder: Folder) -> Self {
        let (inputs, warnings) = Default::default();
        Self { main, folder, ignored: Ignored::default(), inputs, warnings }
    }

    pub(super) fn ignore<'p>(&mut self, feature: Feature, place: impl Into<Option<&'p Place>>) {
        self.ignore_named(feature, feature.name, place);
    }

    /// Counts a part, if it has a place: that of a parameter, say, that may be given.
    pub(super) fn ignore_named<'p>(
        &mut self,
        feature: Feature,
        name: &str,
        place: impl Into<Option<&'p Place>>,
    ) {
        let main = self.main;
        if let Some(place) = place.into() {
            self.ignored.add_named(feature, name, || place.describe(main));
        }
    }

    /// Counts the parameters of a directive that nothing has asked for.
    pub(super) fn unused(&mut self, entity: &Entity) {
        for parameter in entity.unused() {
            let name = match entity.directive {
                // Their names are the author's own.
                "MakeNamedMaterial" => format!("parameter `{}` of materials", parameter.name),
                _ => format!("parameter `{}` of {}", parameter.name, entity.label()),
            };
            self.ignore_named(features::PBRT_PARAMETER, &name, &parameter.place);
        }
    }
}
