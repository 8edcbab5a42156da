//! XML files → one tree of elements: included files are in place, `$name` is replaced, and names are
//! those of version 3.

use std::{
    cell::RefCell,
    collections::{BTreeSet, HashMap},
    fs,
    path::{Path, PathBuf},
};

use roxmltree::ParsingOptions;

use crate::{
    beside::{Folder, in_another_case},
    error::{Error, Result},
    features::{self, Ignored},
    files,
};

/// Deepest nesting of elements, included files counted.
const MAX_DEPTH: usize = 32;
/// Most elements of all files together; a file may be included many times.
const MAX_ELEMENTS: usize = 1 << 21;
const MAX_FILE_BYTES: u64 = 1 << 28;
const MAX_INCLUDES: usize = 256;
/// Most characters of a value with its `$name` replaced: defaults may name each other.
const MAX_VALUE: usize = 1 << 16;

/// Elements of a scene file and those that it includes.
#[derive(Debug, Default)]
pub(super) struct Document {
    elements: Vec<Element>,
    /// Files in the order in which they were met; the scene first.
    pub files: Vec<PathBuf>,
    folder: Folder,
    /// Folders of `path`, in which names start too.
    search: Vec<PathBuf>,
    /// Version of the format that the scene states; 3 if it states none.
    version: f32,
    /// Files whose names are written in another case.
    renamed: RefCell<BTreeSet<String>>,
    /// Element of each name.
    ids: HashMap<String, usize>,
}

#[derive(Debug, Default)]
struct Element {
    tag: String,
    attributes: Vec<(String, String)>,
    children: Vec<usize>,
    file: usize,
    line: u32,
}

/// Element of a [`Document`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<'a> {
    pub document: &'a Document,
    /// Number of the element, by which it is told from others.
    pub index: usize,
}

impl<'a> Node<'a> {
    fn element(self) -> &'a Element {
        &self.document.elements[self.index]
    }

    pub(super) fn tag(self) -> &'a str {
        &self.element().tag
    }

    pub(super) fn attribute(self, name: &str) -> Option<&'a str> {
        let found = self.element().attributes.iter().find(|(own, _)| own == name);
        found.map(|(_, value)| value.as_str())
    }

    /// Name of the parameter that the element is; empty if it has none.
    pub(super) fn name(self) -> &'a str {
        self.attribute("name").unwrap_or_default()
    }

    /// Type of the plugin; empty if it has none.
    pub(super) fn kind(self) -> &'a str {
        self.attribute("type").unwrap_or_default()
    }

    /// Version of the format that the scene states.
    pub(super) fn version(self) -> f32 {
        self.document.version
    }

    pub(super) fn children(self) -> impl Iterator<Item = Node<'a>> {
        let document = self.document;
        self.element().children.iter().map(move |&index| Node { document, index })
    }

    /// Element that a `ref` names; any other is itself.
    pub(super) fn target(self) -> Result<Node<'a>> {
        if self.tag() != "ref" {
            return Ok(self);
        }
        let id = self.attribute("id").unwrap_or_default();
        match self.document.ids.get(id) {
            Some(&index) => Ok(Node { document: self.document, index }),
            None => Err(self.error(format!("expected the id of an object, found `{id}`"))),
        }
    }

    /// Line for warnings, with the file where it is not the scene.
    pub(super) fn place(self) -> String {
        let Element { file, line, .. } = self.element();
        if *file == 0 {
            format!("line {line}")
        } else {
            format!("{}:{line}", self.document.files[*file].display())
        }
    }

    pub(super) fn error(self, message: impl Into<String>) -> Error {
        let Element { file, line, .. } = self.element();
        Error::parse(&self.document.files[*file], *line as usize, 1, message)
    }

    /// Path of a file that the element names: in the scene's folder, or in one of its `path`s. Fails for a
    /// name that leaves the folder of the scene, or a file that is not there.
    pub(super) fn file(self, name: &str) -> Result<PathBuf> {
        self.document.resolve(name).flatten().map_err(|message| self.error(message))
    }

    /// As [`Node::file`]; none inside for a file that is not there. Fails for a name that leaves the folder
    /// of the scene.
    pub(super) fn file_if_there(self, name: &str) -> Result<Option<PathBuf>> {
        self.document.resolve(name).map(Result::ok).map_err(|message| self.error(message))
    }
}

impl Document {
    /// Reads the scene file and all that it includes; names of files start in `folder`. Fails with
    /// [`Error::Parse`] with the line, or as reading does.
    pub(super) fn read(path: &Path, folder: Folder) -> Result<Self> {
        let mut builder = Builder {
            document: Self { folder, version: 3.0, ..Self::default() },
            ..Builder::default()
        };
        let root = Element { tag: "scene".to_owned(), line: 1, ..Element::default() };
        builder.document.elements.push(root);
        builder.file(path, 0, 0)?;
        Ok(builder.document)
    }

    pub(super) fn root(&self) -> Node<'_> {
        Node { document: self, index: 0 }
    }

    /// Files that textures name, as far as they are there.
    pub(super) fn images(&self) -> Vec<PathBuf> {
        let nodes = (0..self.elements.len()).map(|index| Node { document: self, index });
        let parameters = nodes.filter(|node| node.tag() == "texture").flat_map(Node::children);
        let names = parameters.filter(|node| node.name() == "filename");
        names.filter_map(|node| self.resolve(node.attribute("value")?).ok()?.ok()).collect()
    }

    /// Finds a file by its name, in another case if there is none in its own; inside is a message on one that
    /// is not there. Fails for a name that no file may have.
    fn resolve(&self, name: &str) -> Result<Result<PathBuf, String>, String> {
        let own = [PathBuf::new()];
        let folders = own.iter().chain(&self.search);
        let paths = folders.map(|folder| self.folder.file_within(folder, name));
        let (paths, forbidden): (Vec<_>, Vec<_>) = paths.partition(Result::is_ok);
        let paths: Vec<_> = paths.into_iter().flatten().collect();
        if let Some(path) = paths.iter().find(|path| path.exists()) {
            return Ok(Ok(path.clone()));
        }
        if let Some(path) = paths.iter().find_map(|path| in_another_case(path)) {
            self.renamed.borrow_mut().insert(name.to_owned());
            return Ok(Ok(path));
        }
        if let Some(message) = forbidden.into_iter().find_map(Result::err) {
            return Err(message);
        }
        let sought: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
        let sought = sought.join(" or ");
        Ok(Err(format!("the file `{name}` is not there; expected {sought}")))
    }

    /// Warnings on files in another case.
    pub(super) fn renamed(&self) -> Ignored {
        let mut renamed = Ignored::default();
        for name in self.renamed.borrow().iter() {
            renamed.add(features::MI_FILE_CASE, || format!("`{name}`"));
        }
        renamed
    }
}

#[derive(Default)]
struct Builder {
    document: Document,
    defaults: HashMap<String, String>,
    /// Files being read, for a file that includes itself.
    open: Vec<PathBuf>,
}

impl Builder {
    /// Adds the elements of a file to those of `parent`.
    fn file(&mut self, path: &Path, parent: usize, depth: usize) -> Result<()> {
        let bytes = fs::metadata(path).map_or(0, |metadata| metadata.len());
        if bytes > MAX_FILE_BYTES {
            let message = format!("expected at most {MAX_FILE_BYTES} bytes of XML, found {bytes}");
            return Err(Error::format(path, message));
        }
        let xml_text = strict(&files::decoded(&files::read(path)?));
        let file = self.document.files.len();
        self.document.files.push(path.to_path_buf());
        self.open.push(path.to_path_buf());
        // A document type could define entities, which the format has no use for.
        let options =
            ParsingOptions { nodes_limit: 8 * MAX_ELEMENTS as u32, ..ParsingOptions::default() };
        let xml = roxmltree::Document::parse_with_options(&xml_text, options).map_err(|error| {
            let at = error.pos();
            Error::parse(path, at.row as usize, at.col as usize, error.to_string())
        })?;
        let root = xml.root_element();
        let lines = Lines::new(&xml_text);
        if root.tag_name().name() != "scene" {
            let message = format!(
                "expected the element `scene` of a Mitsuba file, found `{}`",
                root.tag_name().name()
            );
            return Err(Error::parse(path, lines.line(root.range().start) as usize, 1, message));
        }
        if file == 0
            && let Some(version) = root.attribute("version")
        {
            let first = version.split('.').take(2).collect::<Vec<_>>().join(".");
            self.document.version = first.parse().unwrap_or(self.document.version);
        }
        let source = Source { path, file, lines: &lines };
        self.children(&source, root, parent, depth)?;
        self.open.pop();
        Ok(())
    }

    fn element(
        &mut self,
        source: &Source,
        node: roxmltree::Node,
        parent: usize,
        depth: usize,
    ) -> Result<()> {
        let line = source.lines.line(node.range().start);
        let error = |message: String| Error::parse(source.path, line as usize, 1, message);
        if depth > MAX_DEPTH {
            return Err(error(format!("elements are nested deeper than {MAX_DEPTH}")));
        }
        if self.document.elements.len() >= MAX_ELEMENTS {
            return Err(error(format!("more than {MAX_ELEMENTS} elements")));
        }
        let tag = node.tag_name().name();
        let mut attributes = Vec::new();
        for attribute in node.attributes() {
            let value = self.replace(attribute.value()).map_err(error)?;
            let value = match attribute.name() {
                "name" if tag != "default" => snake_case(&value),
                // Plugins are files, whose case some systems do not tell apart.
                "type" => value.to_ascii_lowercase(),
                _ => value,
            };
            attributes.push((attribute.name().to_owned(), value));
        }
        let attribute = |name: &str| {
            let found = attributes.iter().find(|(own, _)| own == name);
            found
                .map(|(_, value)| value.clone())
                .ok_or_else(|| error(format!("`{tag}`: expected the attribute `{name}`")))
        };
        match tag {
            "default" => {
                let (name, value) = (attribute("name")?, attribute("value")?);
                self.defaults.entry(name).or_insert(value);
                return Ok(());
            }
            "path" => {
                let folder = PathBuf::from(attribute("value")?.replace('\\', "/"));
                self.document.search.push(folder);
                return Ok(());
            }
            "alias" => {
                let (id, alias) = (attribute("id")?, attribute("as")?);
                let Some(&index) = self.document.ids.get(&id) else {
                    return Err(error(format!("alias: expected an id above, found `{id}`")));
                };
                self.document.ids.insert(alias, index);
                return Ok(());
            }
            "include" => return self.include(&attribute("filename")?, parent, depth, &error),
            // Shapes of one mesh look as they do one by one.
            "shape" if attribute("type").is_ok_and(|kind| kind == "merge") => {
                return self.children(source, node, parent, depth);
            }
            _ => {}
        }
        let index = self.document.elements.len();
        let id = if tag == "ref" { None } else { attribute("id").ok() };
        let is_texture =
            tag == "spectrum" && attribute("type").is_ok_and(|kind| !is_spectrum(&kind));
        let element = Element {
            tag: if is_texture { "texture" } else { tag }.to_owned(),
            attributes,
            children: Vec::new(),
            file: source.file,
            line,
        };
        self.document.elements.push(element);
        self.document.elements[parent].children.push(index);
        if let Some(id) = id
            && let Some(first) = self.document.ids.insert(id.clone(), index)
        {
            let place = Node { document: &self.document, index: first }.place();
            return Err(error(format!("the id `{id}` is taken by the element of {place}")));
        }
        self.children(source, node, index, depth)
    }

    fn children(
        &mut self,
        source: &Source,
        node: roxmltree::Node,
        parent: usize,
        depth: usize,
    ) -> Result<()> {
        let mut children = node.children().filter(roxmltree::Node::is_element);
        children.try_for_each(|child| self.element(source, child, parent, depth + 1))
    }

    fn include(
        &mut self,
        name: &str,
        parent: usize,
        depth: usize,
        error: &dyn Fn(String) -> Error,
    ) -> Result<()> {
        let path = self.document.resolve(name).flatten().map_err(error)?;
        if self.document.files.len() > MAX_INCLUDES {
            return Err(error(format!("more than {MAX_INCLUDES} files are included")));
        }
        if self.open.iter().any(|open| files::is_same_file(open, &path)) {
            return Err(error(format!("`{name}` includes itself")));
        }
        self.file(&path, parent, depth)
    }

    /// Replaces `$name` by the value of its `default`, the longest name first, as Mitsuba does.
    fn replace(&self, value: &str) -> Result<String, String> {
        let mut replaced = String::with_capacity(value.len());
        let mut rest = value;
        while let Some(at) = rest.find('$') {
            replaced.push_str(&rest[..at]);
            rest = &rest[at + 1..];
            let is_start = |(name, _): &(&String, &String)| rest.starts_with(name.as_str());
            let longest = self.defaults.iter().filter(is_start).max_by_key(|(name, _)| name.len());
            let Some((name, default)) = longest else {
                let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
                let name = &rest[..end.unwrap_or(rest.len())];
                return Err(format!(
                    "`${name}` has no value; expected `<default name=\"{name}\" value=\"…\"/>` above, in \
                     place of Mitsuba's option `-D {name}=…`"
                ));
            };
            replaced.push_str(default);
            rest = &rest[name.len()..];
            if replaced.len() > MAX_VALUE {
                return Err(format!("a value of more than {MAX_VALUE} characters"));
            }
        }
        replaced.push_str(rest);
        Ok(replaced)
    }
}

/// Text as a strict reader takes it, with its lines where they are: Mitsuba's reader takes comments of
/// dashes, `&` in names, document types, and space above the declaration, which files written by hand have.
fn strict(text: &str) -> String {
    let mut strict = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(['<', '&']) {
        strict.push_str(&rest[..at]);
        rest = &rest[at..];
        let ends = [("<!--", "-->"), ("<?", "?>"), ("<!DOCTYPE", ">")];
        let skipped = ends.into_iter().find_map(|(start, end)| {
            let inside = rest.strip_prefix(start)?;
            Some(inside.find(end).map_or(rest.len(), |at| start.len() + at + end.len()))
        });
        if let Some(length) = skipped {
            let space = |c| if c == '\n' { c } else { ' ' };
            strict.extend(rest[..length].chars().map(space));
            rest = &rest[length..];
        } else {
            let names = ["&amp;", "&lt;", "&gt;", "&quot;", "&apos;", "&#"];
            let is_bare = rest.starts_with('&') && !names.iter().any(|name| rest.starts_with(name));
            strict.push_str(if is_bare { "&amp;" } else { &rest[..1] });
            rest = &rest[1..];
        }
    }
    strict + rest
}

/// File being read.
struct Source<'a> {
    path: &'a Path,
    file: usize,
    lines: &'a Lines,
}

/// Starts of the lines of a text.
pub(super) struct Lines(Vec<usize>);

impl Lines {
    pub(super) fn new(text: &str) -> Self {
        Self(text.match_indices('\n').map(|(at, _)| at + 1).collect())
    }

    /// Line of a byte, from 1.
    pub(super) fn line(&self, byte: usize) -> u32 {
        self.0.partition_point(|start| *start <= byte) as u32 + 1
    }
}

/// Tells spectra from textures by their type; both may be the element `spectrum`.
pub(super) fn is_spectrum(kind: &str) -> bool {
    let kinds = ["", "blackbody", "uniform", "d65", "srgb", "rgb", "regular", "irregular"];
    kinds.contains(&kind)
}

/// Name of version 3 for one of version 0.6: `toWorld` is `to_world`, `intIOR` `int_ior`.
pub(super) fn snake_case(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 2);
    let mut before = '_';
    for c in name.chars() {
        if c.is_ascii_uppercase() && (before.is_ascii_lowercase() || before.is_ascii_digit()) {
            snake.push('_');
        }
        snake.push(c.to_ascii_lowercase());
        before = c;
    }
    snake
}
